use super::*;

#[test]
fn all_texts_are_escaped() {
    let rows = [("<b>&\"'".to_owned(), "1 < 2\0".to_owned())];
    let sections = [Section {
        heading: "<h>",
        rows: &rows,
    }];
    let figures = [Figure {
        svg: "<svg/>",
        caption: "a </figure> & b",
    }];
    let page = html("</title><script>", "<lead>", &sections, &figures);

    assert!(page.contains("<title>&lt;/title&gt;&lt;script&gt;</title>"));
    assert!(page.contains("<p>&lt;lead&gt;</p>"));
    assert!(page.contains(">&lt;h&gt;</h2>"));
    assert!(page.contains("<th scope=\"row\">&lt;b&gt;&amp;&quot;&#39;</th>"));
    assert!(page.contains("<td>1 &lt; 2</td>"));
    assert!(page.contains("<figcaption>a &lt;/figure&gt; &amp; b</figcaption>"));
    assert!(!page.contains("<script"));
}

#[test]
fn page_loads_nothing() {
    let values = [Some(1.0), None];
    let map = crate::picture::Map {
        title: "t",
        unit: "m",
        columns: 2,
        rows: 1,
        values: &values,
    };
    let svg = crate::picture::heat_map(&map).unwrap();
    let figures = [Figure {
        svg: &svg,
        caption: "c",
    }; 3];
    let page = html("t", "l", &[], &figures);

    assert_eq!(page.matches("<svg").count(), 3);
    for word in ["src=", "href", "@import", "url(", "<script", "<link"] {
        assert!(!page.contains(word), "{word}");
    }
    let addresses = page.matches("http://").count() + page.matches("https://").count();
    assert_eq!(
        addresses,
        page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count()
    );
}

#[test]
fn figures_stand_in_the_page_as_elements() {
    let svg = "<?xml version=\"1.0\"?>\n<svg width=\"1\"/>\n";
    let figures = [Figure { svg, caption: "c" }, Figure { svg, caption: "d" }];
    let page = html("t", "l", &[], &figures);
    assert_eq!(page.matches("<svg width=\"1\"/>").count(), 2);
    assert!(!page.contains("<?xml"));
}

#[test]
fn page_is_deterministic() {
    let rows = [("a".to_owned(), "b".to_owned())];
    let sections = [Section {
        heading: "h",
        rows: &rows,
    }; 2];
    let page = || html("t", "l", &sections, &[]);
    assert_eq!(page(), page());
    assert!(page().contains("id=\"section-2\""));
}
