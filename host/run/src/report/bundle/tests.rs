use super::{Error, bundle};

#[test]
fn a_module_stands_after_those_that_it_imports() {
    let modules = [
        (
            "page/main.js",
            "import { two } from \"../shared/b-c.js\";\nimport { one } from \"./a.js\";\none(two);\n",
        ),
        ("page/a.js", "// A comment.\n\nexport function one() {}\n"),
        (
            "shared/b-c.js",
            "import { one } from \"../page/a.js\";\n/** Two\n * lines. */\nexport const two = one() + 1; // 2\n",
        ),
        ("shared/unused.js", "never();\n"),
    ];
    let expected = "const $a = (() => {\nfunction one() {}\nreturn { one };\n})();\n\
                    const $b_c = (() => {\nconst { one } = $a;\nconst two = one() + 1; // 2\nreturn { two };\n})();\n\
                    const $main = (() => {\nconst { two } = $b_c;\nconst { one } = $a;\none(two);\nreturn {  };\n})();\n";
    assert_eq!(bundle("page/main.js", &modules).unwrap(), expected);
}

#[test]
fn modules_with_the_same_name_inside_are_kept_apart() {
    let modules = [
        ("a.js", "const same = 1;\nexport const one = same;\n"),
        (
            "main.js",
            "import { one } from \"./a.js\";\nconst same = 2;\nconsole.log(one + same);\n",
        ),
    ];
    let script = bundle("main.js", &modules).unwrap();
    // Each within its own function.
    let (first, second) = script.split_once("})();").unwrap();
    assert!(first.contains("const same = 1;") && second.contains("const same = 2;"));
    assert_eq!(script.matches("(() => {").count(), 2);
}

#[test]
fn what_is_not_there_is_told() {
    let main = |import: &str| {
        bundle(
            "main.js",
            &[("main.js", import), ("a.js", "export const one = 1;")],
        )
    };
    let text = |import| main(import).unwrap_err().to_string();
    assert!(main("import { one } from \"./a.js\";").is_ok());
    assert_eq!(
        text("import { one } from \"./b.js\";"),
        "main.js: there is no b.js"
    );
    assert_eq!(
        text("import { one, two } from \"./a.js\";"),
        "main.js: a.js does not export two"
    );
    let nothing = bundle("main.js", &[]).unwrap_err();
    let expected = Error::NoModule {
        module: String::new(),
        from: "main.js".to_owned(),
    };
    assert_eq!(nothing, expected);
}

#[test]
fn a_circle_is_told() {
    let modules = [
        ("main.js", "import { a } from \"./a.js\";"),
        ("a.js", "import { b } from \"./b.js\";\nexport const a = b;"),
        ("b.js", "import { a } from \"./a.js\";\nexport const b = a;"),
    ];
    let error = bundle("main.js", &modules).unwrap_err();
    assert_eq!(error.to_string(), "a circle of imports: a.js → b.js → a.js");
    let own = [(
        "main.js",
        "import { a } from \"./main.js\";\nexport const a = 1;",
    )];
    assert!(matches!(bundle("main.js", &own), Err(Error::Circle(_))));
}

#[test]
fn two_files_of_the_same_name_are_told() {
    let modules = [
        ("page/a.js", "import { one } from \"../shared/a.js\";"),
        ("shared/a.js", "export const one = 1;"),
    ];
    let error = bundle("page/a.js", &modules).unwrap_err();
    assert_eq!(error, Error::SameFile("page/a.js".to_owned()));
}

#[test]
fn other_syntax_is_refused() {
    for line in [
        "import \"./a.js\";",
        "import a from \"./a.js\";",
        "import * as a from \"./a.js\";",
        "import { one as two } from \"./a.js\";",
        "import { one } from './a.js';",
        "import { one } from \"a\";",
        "import { one } from \"https://a/b.js\";",
        "import { one } from \"./a.js\"",
        "import {",
        " import { one } from \"./a.js\";",
        "const a = await import(\"./a.js\");",
        "console.log(import.meta.url);",
        "export let one = 1;",
        "export var one = 1;",
        "export default one;",
        "export class One {}",
        "export { one };",
        "export { one } from \"./a.js\";",
        "export const { one, two } = three;",
        "const text = `of two lines",
        "/* one */ two();",
    ] {
        let modules = [("main.js", line), ("a.js", "export const one = 1;")];
        let expected = Error::Line {
            module: "main.js".to_owned(),
            line: line.to_owned(),
        };
        assert_eq!(bundle("main.js", &modules), Err(expected), "{line}");
    }
}
