//! The imports between the files of a package, read from their syntax.
//!
//! An import is a path that begins with `crate`, `self` or `super`. It leads to the deepest module on
//! it, or to the origin of a `pub use` there. A module and its folder count as one: items that a child
//! takes from its parent are no import. Tests are left out.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use syn::visit::Visit;

/// A module by its path from the package, `["detect", "window"]`.
type Module = Vec<String>;
/// The imports of each module.
pub type Imports = BTreeMap<Module, BTreeSet<Module>>;

/// The imports of all modules below `source`.
pub fn imports(source: &Path) -> Imports {
    let mut files = BTreeMap::new();
    read(source, &mut Vec::new(), &mut files);
    let modules: BTreeSet<&Module> = files.keys().collect();
    let paths = |module: &Module, items: &Vec<syn::Item>| {
        let mut paths = Paths {
            module: module.clone(),
            found: Vec::new(),
            handed_on: Vec::new(),
        };
        items.iter().for_each(|item| paths.visit_item(item));
        paths
    };
    let mut handed_on = BTreeMap::new();
    for (module, items) in &files {
        for (name, path) in paths(module, items).handed_on {
            handed_on.insert([&module[..], &[name]].concat(), path);
        }
    }
    let deepest = |path: &Module| {
        let lengths = (0..=path.len()).rev();
        lengths
            .map(|length| path[..length].to_vec())
            .find(|path| path.is_empty() || modules.contains(path))
    };
    let leads = |path: &Module| {
        let mut path = path.clone();
        // A reexport may be reexported.
        for _ in 0..4 {
            let module = deepest(&path)?;
            let next = path
                .get(..=module.len())
                .and_then(|name| handed_on.get(name));
            let Some(next) = next else { break };
            path = [&next[..], &path[module.len() + 1..]].concat();
        }
        deepest(&path).filter(|module| !module.is_empty())
    };
    let of = |(module, items): (&Module, &Vec<syn::Item>)| {
        let paths = paths(module, items);
        let led = paths.found.iter().filter_map(leads);
        (
            module.clone(),
            led.filter(|to| !module.starts_with(to)).collect(),
        )
    };
    files.iter().map(of).collect()
}

fn read(folder: &Path, module: &mut Module, files: &mut BTreeMap<Module, Vec<syn::Item>>) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for path in entries.map(|entry| entry.unwrap().path()) {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            module.push(name);
            read(&path, module, files);
            module.pop();
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let mut module = module.clone();
            match name.as_str() {
                "tests" => continue,
                "mod" | "lib" | "main" => {}
                _ => module.push(name),
            }
            let file = syn::parse_file(&fs::read_to_string(&path).unwrap()).unwrap();
            // A program and its library have the same root.
            files.entry(module).or_default().extend(file.items);
        }
    }
}

/// Collects paths, relative to the package.
struct Paths {
    module: Module,
    found: Vec<Module>,
    /// Names of `pub use`, and their targets.
    handed_on: Vec<(String, Module)>,
}

impl Paths {
    /// Adds a path if it begins in the package.
    fn note(&mut self, path: &[String]) {
        self.found.extend(self.absolute(path));
    }

    fn absolute(&self, path: &[String]) -> Option<Module> {
        let mut from = self.module.clone();
        let mut rest = path;
        match path.first().map(String::as_str) {
            Some("crate") => from.clear(),
            Some("self") => {}
            Some("super") => {
                from.pop();
            }
            _ => return None,
        }
        rest = &rest[1..];
        while rest.first().is_some_and(|first| first == "super") {
            from.pop();
            rest = &rest[1..];
        }
        Some([&from, rest].concat())
    }

    /// Adds a reexport. Its path may begin with a module of this one.
    fn hand_on(&mut self, name: &syn::Ident, path: &[String]) {
        let of_child = || [&self.module[..], path].concat();
        let path = self.absolute(path).unwrap_or_else(of_child);
        self.handed_on.push((name.to_string(), path));
    }

    fn tree(&mut self, before: &mut Module, tree: &syn::UseTree, is_public: bool) {
        match tree {
            syn::UseTree::Path(path) => {
                before.push(path.ident.to_string());
                self.tree(before, &path.tree, is_public);
                before.pop();
            }
            syn::UseTree::Group(group) => {
                for tree in &group.items {
                    self.tree(before, tree, is_public);
                }
            }
            syn::UseTree::Name(syn::UseName { ident })
            | syn::UseTree::Rename(syn::UseRename { ident, .. }) => {
                before.push(ident.to_string());
                self.note(before);
                if is_public {
                    let name = match tree {
                        syn::UseTree::Rename(renamed) => &renamed.rename,
                        _ => ident,
                    };
                    self.hand_on(name, before);
                }
                before.pop();
            }
            syn::UseTree::Glob(_) => self.note(before),
        }
    }
}

/// Whether an item exists in tests only.
fn is_test(attributes: &[syn::Attribute]) -> bool {
    attributes.iter().any(|attribute| {
        attribute.path().is_ident("cfg")
            && attribute
                .parse_args::<syn::Ident>()
                .is_ok_and(|of| of == "test")
    })
}

impl<'file> Visit<'file> for Paths {
    fn visit_item_mod(&mut self, item: &'file syn::ItemMod) {
        if !is_test(&item.attrs) {
            syn::visit::visit_item_mod(self, item);
        }
    }

    fn visit_item_use(&mut self, item: &'file syn::ItemUse) {
        if !is_test(&item.attrs) {
            let is_public = !matches!(item.vis, syn::Visibility::Inherited);
            self.tree(&mut Vec::new(), &item.tree, is_public);
        }
    }

    fn visit_path(&mut self, path: &'file syn::Path) {
        let names: Vec<String> = path
            .segments
            .iter()
            .map(|segment| segment.ident.to_string())
            .collect();
        self.note(&names);
        syn::visit::visit_path(self, path);
    }
}

/// Import cycles of files and folders. Entries of the same folder are compared: a folder imports
/// everything that one of its files imports, so a cycle of files appears where their paths part.
pub fn circles(imports: &Imports) -> Vec<Vec<String>> {
    let folders: BTreeSet<&[String]> = imports
        .keys()
        .flat_map(|module| (0..module.len()).map(|depth| &module[..depth]))
        .collect();
    let within = |folder| circles_of(&side_by_side(imports, folder));
    folders.into_iter().flat_map(within).collect()
}

/// The imports between the files and folders in `folder`.
fn side_by_side<'a>(
    imports: &'a Imports,
    folder: &[String],
) -> BTreeMap<&'a [String], BTreeSet<&'a [String]>> {
    let here = |module: &'a Module| {
        let is_below = module.len() > folder.len() && module.starts_with(folder);
        is_below.then(|| &module[..=folder.len()])
    };
    let mut found = BTreeMap::<_, BTreeSet<_>>::new();
    for (from, to) in imports {
        if let Some(from) = here(from) {
            let to = to.iter().filter_map(here).filter(|&to| to != from);
            found.entry(from).or_default().extend(to);
        }
    }
    found
}

fn circles_of(imports: &BTreeMap<&[String], BTreeSet<&[String]>>) -> Vec<Vec<String>> {
    let reached = |from| {
        let (mut reached, mut next) = (BTreeSet::new(), vec![from]);
        while let Some(place) = next.pop() {
            let to = imports.get(place).into_iter().flatten();
            next.extend(to.filter(|&&to| reached.insert(to)));
        }
        reached
    };
    let reached: BTreeMap<&[String], BTreeSet<&[String]>> = imports
        .keys()
        .map(|&place| (place, reached(place)))
        .collect();
    let in_circle = imports
        .keys()
        .filter(|&place| reached[place].contains(place));
    let circle = |place: &&[String]| -> Vec<String> {
        let back =
            |other: &&&[String]| reached[place].contains(*other) && reached[*other].contains(place);
        let places = imports.keys().filter(back);
        places.map(|place| place.join("::")).collect()
    };
    let circles: BTreeSet<Vec<String>> = in_circle.map(circle).collect();
    circles.into_iter().collect()
}
