//! HTML pages in one file that need no network, and the parts of charts in them.

pub mod chart;

/// A whole page, light or dark as its reader likes. `title` is text, `body` is HTML.
pub fn page(title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\">\
         <title>{}</title><style>{STYLE}</style></head>\n<body>\n{body}</body></html>\n",
        escape(title)
    )
}

/// Text for HTML: names come from folders and manifests.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1a1a1a; --soft: #666; --line: #ddd; --paper: #fff; --error: #d0342c;
  --c0: #3366cc; --c1: #e08b1d; --c2: #2f9e5b; --c3: #9350b0; --c4: #5b8a9a; --c5: #b0556a; --c6: #7a7a2e; --c7: #888; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --soft: #a0a0a0; --line: #3a3a3a; --paper: #161616;
  --error: #ff6b60; --c0: #7aa2f7; --c1: #f0ad4e; --c2: #63c98b; --c3: #c792ea; --c4: #89c4d6; --c5: #e58ba0;
  --c6: #c5c56a; --c7: #aaa; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 72rem;
  margin: 2rem auto; padding: 0 1rem; }
section { border-top: 1px solid var(--line); margin-top: 2rem; }
.source { color: var(--soft); }
.wide { overflow-x: auto; } .wide svg { min-width: 40rem; }
.wide th:first-child { position: sticky; left: 0; background: var(--paper); min-width: 6rem; max-width: 16rem; }
dt { color: var(--soft); float: left; clear: left; width: 9rem; } dd { margin: 0 0 .25rem 9.5rem; overflow-wrap: anywhere; }
@media (max-width: 40rem) { dt { float: none; } dd { margin-left: 0; } }
a { color: var(--c0); }
table { border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: 600; } th, td { padding: .25rem .75rem .25rem 0; border-bottom: 1px solid var(--line); }
td { white-space: nowrap; } i { color: var(--soft); }
svg { display: block; max-width: 100%; height: auto; margin: 1rem 0; } svg text { fill: var(--ink); font-size: 11px; }
svg .grid { stroke: var(--line); }
svg .wall { stroke: var(--ink); stroke-width: 1.5; } svg .error { fill: none; stroke: var(--error); stroke-width: 2; }
.f0 { fill: var(--c0); } .f1 { fill: var(--c1); } .f2 { fill: var(--c2); } .f3 { fill: var(--c3); }
.f4 { fill: var(--c4); } .f5 { fill: var(--c5); } .f6 { fill: var(--c6); } .f7 { fill: var(--c7); }
polyline { fill: none; stroke-width: 2; } .l0 { stroke: var(--c0); } .l1 { stroke: var(--c1); } .l2 { stroke: var(--c2); }
.l3 { stroke: var(--c3); } .l4 { stroke: var(--c4); } .l5 { stroke: var(--c5); } .l6 { stroke: var(--c6); }
.l7 { stroke: var(--c7); }
";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_become_markup() {
        assert_eq!(escape("<b>\"Tom & Ann's\"</b>"), "&lt;b&gt;&quot;Tom &amp; Ann's&quot;&lt;/b&gt;");
    }
}
