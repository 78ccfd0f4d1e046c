//! Every study: trials are pure functions, and one seed is enough for results.

use std::collections::BTreeSet;
use std::fs;

use dtof_lab::studies;
use dtof_lab::sweep;

#[test]
#[ignore = "takes minutes: `.ci/long studies` runs it"]
fn one_seed_of_every_study_gives_figures_and_claims() {
    let mut names = BTreeSet::new();
    for study in studies::ALL {
        let results = (study.results)(&sweep::run_seeds(study, 0..1).unwrap()).unwrap();
        assert!(!results.figures.is_empty(), "{}", study.name);
        for figure in &results.figures {
            assert!(names.insert(figure.name), "{} twice", figure.name);
            let svg = figure.svg.trim_end();
            assert!(svg.starts_with("<svg") && svg.ends_with("</svg>"), "{svg}");
            // At least one dot or line besides axes and legend.
            let is_drawn = ["<circle", "<polyline"].map(|shape| svg.contains(shape));
            assert_ne!(is_drawn, [false; 2], "{svg}");
        }
        for claim in &results.claims {
            // A cell of a table, and cells of a CSV table.
            let text = &claim.here;
            assert!(!text.is_empty() && !text.contains(['|', '\n']), "{text}");
            for text in [&claim.here, &claim.details] {
                assert!(
                    !text.contains("NaN") && !text.contains(['"', '\n']),
                    "{text}"
                );
            }
        }
    }
}

#[test]
#[ignore = "takes minutes: `.ci/long studies` runs it"]
fn a_trial_depends_on_its_point_and_random_numbers_only() {
    use rand_core::SeedableRng;
    use rand_pcg::Pcg64;
    for study in studies::ALL {
        let points = (study.points)();
        assert_eq!(points, (study.points)(), "{}", study.name);
        // A few points across the grid, in both orders.
        let some: Vec<_> = points.iter().step_by(points.len().div_ceil(4)).collect();
        let trials = |seed| {
            let trial =
                move |point: &&_| (study.trial)(point, &mut Pcg64::seed_from_u64(seed)).unwrap();
            let forward: Vec<_> = some.iter().map(trial).collect();
            let mut backward: Vec<_> = some.iter().rev().map(trial).collect();
            backward.reverse();
            assert_eq!(forward, backward, "{}", study.name);
            forward
        };
        assert_ne!(trials(1), trials(2), "{}: not random", study.name);
    }
}

/// One reader, one question; the rest is data.
#[test]
fn pages_of_results_are_short() {
    for page in ["failures.md", "paper-claims.md"] {
        let path = format!("{}/../docs/results/{page}", env!("CARGO_MANIFEST_DIR"));
        let text = fs::read_to_string(path).unwrap();
        let words = text.split_whitespace().count();
        assert!(words < 2500, "{page}: {words}");
        let cells = text.lines().flat_map(|line| line.split('|'));
        let longest = cells.map(|cell| cell.split_whitespace().count()).max();
        assert!(longest <= Some(40), "{page}: {longest:?}");
    }
}

#[test]
fn names_are_unique() {
    let names: BTreeSet<_> = studies::ALL.iter().map(|study| study.name).collect();
    assert_eq!(names.len(), studies::ALL.len());
    for study in studies::ALL {
        assert!(study.few_seeds < study.all_seeds, "{}", study.name);
        assert_eq!(studies::named(study.name).unwrap().about, study.about);
    }
}
