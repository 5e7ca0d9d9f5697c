//! A self-contained page of HTML: style sheet, head, tables. Light or dark according to the reader's system,
//! and readable on a narrow screen.

use std::fmt::Write as _;

/// Colours that people with red-green colour blindness can distinguish (Okabe and Ito 2008).
const STYLE: &str = "
:root{color-scheme:light dark;--bg:#fff;--fg:#1b1f24;--dim:#5b6470;--rule:#d9dee4;--card:#f7f8fa;--good:#0a6b45;--bad:#b3261e;
--c0:#0072b2;--c1:#d55e00;--c2:#009e73;--c3:#b5589b;--c4:#9a7d00;--c5:#3a94c9;--c6:#7a4fd0;--c7:#6b7280}
@media(prefers-color-scheme:dark){:root{--bg:#14171b;--fg:#e6e9ed;--dim:#9aa4b0;--rule:#343b44;--card:#1b2026;--good:#4fd39b;--bad:#ff8a80;
--c0:#56b4e9;--c1:#f08a3c;--c2:#2fcf9f;--c3:#e39ccb;--c4:#e0c341;--c5:#8fd0f5;--c6:#b39bf5;--c7:#a7b0bb}}
*{box-sizing:border-box}
body{margin:0 auto;padding:1.5rem 1rem 4rem;max-width:76rem;background:var(--bg);color:var(--fg);font:15px/1.5 system-ui,sans-serif}
h1{font-size:1.5rem;margin:0 0 .25rem}h2{font-size:1.12rem;margin:0 0 .15rem}p{margin:.3rem 0 .8rem;max-width:62rem}
.note{color:var(--dim);font-size:.9rem}.good{color:var(--good);font-weight:600}.bad{color:var(--bad);font-weight:600}
.wide{overflow-x:auto;margin:1rem 0 1.5rem;border:1px solid var(--rule);border-radius:6px}
table{border-collapse:collapse;width:100%;font-size:.86rem;font-variant-numeric:tabular-nums}
th,td{padding:.34rem .6rem;text-align:right;white-space:nowrap;border-bottom:1px solid var(--rule)}
th:first-child,td:first-child{text-align:left}th{white-space:normal;min-width:3.6rem;line-height:1.25;color:var(--dim);font-weight:600;vertical-align:bottom;background:var(--card)}
tr:last-child td{border-bottom:0}td a{color:inherit}
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,26rem),1fr));gap:1rem}
figure{margin:0;padding:.9rem .9rem .6rem;background:var(--card);border:1px solid var(--rule);border-radius:6px;min-width:0}
figure p{margin:0 0 .5rem;color:var(--dim);font-size:.86rem}
svg{display:block;width:100%;height:auto;overflow:visible}svg text{fill:var(--fg);font:12px system-ui,sans-serif}
svg .label{fill:var(--dim)}.grid{stroke:var(--rule);stroke-width:1}.axis{fill:none;stroke:var(--dim)}
.level{stroke:var(--fg);stroke-dasharray:2 4}.leveltext{font-size:11px!important;fill:var(--dim)!important;paint-order:stroke;stroke:var(--card);stroke-width:4px}
.line{fill:none;stroke-width:1.8;stroke:var(--c)}.dot{fill:var(--c)}.line.dashed{stroke-dasharray:5 4;stroke-width:1.3;opacity:.85}
.dot.dashed{fill:var(--card);stroke:var(--c);stroke-width:1.3}
.legend{list-style:none;display:flex;flex-wrap:wrap;gap:.15rem 1rem;margin:.4rem 0 0;padding:0;font-size:.82rem}
.key{display:inline-block;width:1.3em;height:0;border-top:3px solid var(--c);vertical-align:middle;margin-right:.4em}
.key.dashed{border-top:2px dashed var(--c)}
.c0{--c:var(--c0)}.c1{--c:var(--c1)}.c2{--c:var(--c2)}.c3{--c:var(--c3)}.c4{--c:var(--c4)}.c5{--c:var(--c5)}.c6{--c:var(--c6)}.c7{--c:var(--c7)}
@media print{body{max-width:none}figure{break-inside:avoid}}
";

/// A whole page.
#[must_use]
pub fn page(title: &str, body: &str) -> String {
    let title = escaped(title);
    format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
         <title>{title}</title><style>{STYLE}</style></head>\n<body><h1>{title}</h1>\n{body}</body></html>\n"
    )
}

/// Escapes text for HTML.
#[must_use]
pub fn escaped(text: &str) -> String {
    let mut clean = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => clean += "&amp;",
            '<' => clean += "&lt;",
            '>' => clean += "&gt;",
            '"' => clean += "&quot;",
            c if c.is_control() => clean.push(' '),
            c => clean.push(c),
        }
    }
    clean
}

/// A table; cells are HTML already.
#[must_use]
pub fn table(head: &[&str], rows: &[Vec<String>]) -> String {
    let mut html = "<div class=\"wide\"><table><thead><tr>".to_owned();
    for cell in head {
        let _ = write!(html, "<th>{}</th>", escaped(cell));
    }
    html += "</tr></thead><tbody>";
    for row in rows {
        html += "<tr>";
        for cell in row {
            let _ = write!(html, "<td>{cell}</td>");
        }
        html += "</tr>\n";
    }
    html + "</tbody></table></div>\n"
}

/// A figure: what it shows, what to look at, the plot.
#[must_use]
pub fn figure(title: &str, text: &str, plot: &str) -> String {
    format!(
        "<figure id=\"{}\"><h2>{}</h2><p>{}</p>{plot}</figure>\n",
        escaped(&title.replace(' ', "_")),
        escaped(title),
        escaped(text)
    )
}

/// A count that should be 0, coloured by whether it is.
#[must_use]
pub fn must_be_0(count: &impl std::fmt::Display) -> String {
    let count = count.to_string();
    let class = if count == "0" { "good" } else { "bad" };
    format!("<span class=\"{class}\">{count}</span>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_names_no_other_place_and_escapes_what_it_shows() {
        let page = page(
            "<b> & \"c\"\u{1b}[2J",
            &table(&["a<b"], &[vec![must_be_0(&3)]]),
        );
        assert!(page.contains("&lt;b&gt; &amp; &quot;c&quot; [2J"));
        assert!(!page.contains("http") && !page.contains("src=") && !page.contains("url("));
        assert!(page.contains("class=\"bad\">3<"));
    }
}
