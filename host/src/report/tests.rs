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
fn identifiers_do_not_clash() {
    let svg = "<?xml version=\"1.0\"?>\n<!-- it's --><svg aria-labelledby='t d'>\
        <!-- don't --><title id='t'>id=\"t\" url(#g) a &gt; b</title><desc id=\"d\"/>\
        <g id = \"g\" data-x=\"a>b\"/><use href=\"#g\"/><a href=\"other.svg\"/>\
        <path fill=\"url(#g)\" stroke=\"#abcdef\" style=\"fill:url('#g')\"/></svg>\n";
    let expected = "<svg aria-labelledby='p-t p-d'>\
        <!-- don't --><title id='p-t'>id=\"t\" url(#g) a &gt; b</title><desc id=\"p-d\"/>\
        <g id = \"p-g\" data-x=\"a>b\"/><use href=\"#p-g\"/><a href=\"other.svg\"/>\
        <path fill=\"url(#p-g)\" stroke=\"#abcdef\" style=\"fill:url('#p-g')\"/></svg>";
    assert_eq!(with_own_ids(svg, "p-"), expected);
    assert_eq!(with_own_ids("<svg a='b", "p-"), "<svg a='b");

    let figure = Figure { svg, caption: "" };
    let page = html("t", "l", &[], &[figure, figure]);
    assert_eq!(page.matches(" id='figure-1-t'").count(), 1);
    assert_eq!(page.matches(" id='figure-2-t'").count(), 1);
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
