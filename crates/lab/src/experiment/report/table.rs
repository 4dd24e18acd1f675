//! A table of the report as HTML, as LaTeX and as CSV.

use super::super::KeypointCounts;
use crate::evaluate::Summary;
use crate::page::escape;

/// What stands where nothing could be measured.
const MISSING: &str = "\u{2013}";

/// Named rows under named columns.
#[derive(Clone, Debug)]
pub struct Table {
    /// What its files are called.
    pub name: String,
    /// What it is about.
    pub title: String,
    /// How to read it, in sentences.
    pub notes: Vec<String>,
    /// What the rows are names of.
    pub corner: String,
    /// The columns.
    pub columns: Vec<Column>,
    /// The rows: the name of each, and a value for each column.
    pub rows: Vec<(String, Vec<Value>)>,
}

/// A column of values of one kind.
#[derive(Clone, Debug)]
pub struct Column {
    /// Its name, with the unit of its numbers.
    pub name: String,
    /// What the numbers of a value are called where each has a column of its own; nothing where there is one.
    parts: &'static [&'static str],
}

impl Column {
    /// Of one number or text.
    pub fn single(name: impl Into<String>) -> Self {
        Self { name: name.into(), parts: &[""] }
    }

    /// Of [`Value::Summary`].
    pub fn summary(name: impl Into<String>) -> Self {
        Self { name: name.into(), parts: &[" mean", " std", " best"] }
    }

    /// Of [`Value::Keypoints`].
    pub fn keypoints(name: impl Into<String>) -> Self {
        Self { name: name.into(), parts: &[" mean", " least", " most"] }
    }
}

/// What stands in a cell.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Nothing was measured.
    Missing,
    /// Words.
    Text(String),
    /// A whole number.
    Count(usize),
    /// A number that people read with so many decimals.
    Number(f64, usize),
    /// A share, which people read in percent.
    Rate(f64),
    /// Shares over the seeds, in percent too.
    Summary(Summary),
    /// Keypoints a frame.
    Keypoints(KeypointCounts),
}

impl Value {
    /// As people read it.
    pub fn text(&self) -> String {
        match self {
            Self::Missing => MISSING.to_owned(),
            Self::Text(text) => text.clone(),
            Self::Count(count) => count.to_string(),
            Self::Number(number, n_decimals) => format!("{number:.n_decimals$}"),
            Self::Rate(rate) => percent(*rate),
            Self::Summary(Summary { mean, std: None, .. }) => percent(*mean),
            Self::Summary(Summary { mean, std: Some(std), best, .. }) => {
                format!("{} \u{b1} {} ({})", percent(*mean), percent(*std), percent(*best))
            }
            Self::Keypoints(KeypointCounts { least, mean, most }) => {
                format!("{mean:.0} ({least} to {most})")
            }
        }
    }

    /// Its numbers with all their digits, shares as such.
    fn numbers(&self, n_parts: usize) -> Vec<String> {
        match self {
            Self::Missing => vec![String::new(); n_parts],
            Self::Number(number, _) | Self::Rate(number) => vec![number.to_string()],
            Self::Summary(Summary { mean, std, best, .. }) => {
                let std = std.map_or(String::new(), |std| std.to_string());
                vec![mean.to_string(), std, best.to_string()]
            }
            Self::Keypoints(KeypointCounts { least, mean, most }) => {
                vec![mean.to_string(), least.to_string(), most.to_string()]
            }
            Self::Text(_) | Self::Count(_) => vec![self.text()],
        }
    }
}

/// One decimal, as the papers print rates; without the sign.
pub fn percent(share: f64) -> String {
    format!("{:.1}", 100.0 * share)
}

impl Table {
    /// For the page: it scrolls by itself where it is wider than the window. Its files lie in `folder`.
    pub fn to_html(&self, folder: &str) -> String {
        let mut html = format!("<div class=\"wide\"><table><tr><th>{}</th>", escape(&self.corner));
        self.columns.iter().for_each(|column| html += &format!("<th>{}</th>", escape(&column.name)));
        html += "</tr>\n";
        for (name, values) in &self.rows {
            html += &format!("<tr><th>{}</th>", escape(name));
            values.iter().for_each(|value| html += &format!("<td>{}</td>", escape(&value.text())));
            html += "</tr>\n";
        }
        let path = escape(&format!("{folder}/{}", self.name));
        html += "</table></div>\n<p class=\"source\">";
        self.notes.iter().for_each(|note| html += &format!("{} ", escape(note)));
        html + &format!("<a href=\"{path}.tex\">LaTeX</a>, <a href=\"{path}.csv\">CSV</a></p>\n")
    }

    /// A `tabular` for the package booktabs, with the digits of the page.
    pub fn to_latex(&self) -> String {
        let line = |cells: &mut dyn Iterator<Item = &str>| {
            cells.map(latex).collect::<Vec<_>>().join(" & ") + " \\\\\n"
        };
        let mut text = "% Needs the package booktabs.\n".to_owned();
        for remark in [&self.title].into_iter().chain(&self.notes) {
            // A remark ends with its line.
            let words: Vec<&str> = remark.split_whitespace().collect();
            text += &format!("% {}\n", words.join(" "));
        }
        text += &format!("\\begin{{tabular}}{{l{}}}\n\\toprule\n", "r".repeat(self.columns.len()));
        let names = self.columns.iter().map(|column| column.name.as_str());
        text += &line(&mut [self.corner.as_str()].into_iter().chain(names));
        text += "\\midrule\n";
        for (name, values) in &self.rows {
            let values: Vec<String> = values.iter().map(Value::text).collect();
            text += &line(&mut [name.as_str()].into_iter().chain(values.iter().map(String::as_str)));
        }
        text + "\\bottomrule\n\\end{tabular}\n"
    }

    /// A header and the rows, with all digits; shares are from 0 to 1.
    pub fn to_csv(&self) -> String {
        let names = self.columns.iter().flat_map(|Column { name, parts }| {
            // Percent are how people read shares.
            let name = name.strip_suffix(" (%)").unwrap_or(name);
            parts.iter().map(move |part| format!("{name}{part}"))
        });
        let mut text = record([self.corner.clone()].into_iter().chain(names));
        for (name, values) in &self.rows {
            let numbers = values
                .iter()
                .zip(&self.columns)
                .flat_map(|(value, column)| value.numbers(column.parts.len()));
            text += &record([name.clone()].into_iter().chain(numbers));
        }
        text
    }
}

/// A line of CSV; what could be taken for its syntax is quoted.
fn record(fields: impl Iterator<Item = String>) -> String {
    let quoted = |field: String| {
        let is_plain = !field.contains(['"', ',', '\n', '\r']);
        if is_plain { field } else { format!("\"{}\"", field.replace('"', "\"\"")) }
    };
    fields.map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

/// Text for LaTeX: names come from folders and manifests.
fn latex(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' | '%' | '$' | '#' | '_' | '{' | '}' => escaped.extend(['\\', letter]),
            '\\' => escaped += "\\textbackslash{}",
            '~' => escaped += "\\textasciitilde{}",
            '^' => escaped += "\\textasciicircum{}",
            '<' => escaped += "\\textless{}",
            '>' => escaped += "\\textgreater{}",
            '\u{b1}' => escaped += "$\\pm$",
            '\u{2013}' => escaped += "--",
            letter if letter.is_control() => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn table() -> Table {
        let summary = Summary::of(&[0.5, 0.75]).map(Value::Summary).unwrap();
        Table {
            name: "rates".to_owned(),
            title: "Rates\nof R&D".to_owned(),
            notes: vec!["Percent.".to_owned()],
            corner: "shown \\ answered".to_owned(),
            columns: vec![Column::summary("night_1 (%)"), Column::single("paper (%)")],
            rows: vec![
                ("50% & <more>".to_owned(), vec![summary, Value::Rate(0.9375)]),
                ("none, \"at all\"".to_owned(), vec![Value::Missing, Value::Missing]),
            ],
        }
    }

    #[test]
    fn people_read_percent_and_machines_all_digits() {
        let rates = |rates: &[f64]| Value::Summary(Summary::of(rates).unwrap()).text();
        assert_eq!(rates(&[0.5, 0.75]), "62.5 \u{b1} 17.7 (75.0)");
        assert_eq!(rates(&[1.0]), "100.0");
        assert_eq!(Value::Number(2.345, 2).text(), "2.35");
        assert_eq!(
            table().to_csv(),
            "shown \\ answered,night_1 mean,night_1 std,night_1 best,paper\n\
             50% & <more>,0.625,0.1767766952966369,0.75,0.9375\n\
             \"none, \"\"at all\"\"\",,,,\n"
        );
    }

    #[test]
    fn latex_has_the_digits_of_the_page_and_escapes_names() {
        assert_eq!(
            table().to_latex(),
            "% Needs the package booktabs.\n% Rates of R&D\n% Percent.\n\\begin{tabular}{lrr}\n\\toprule\n\
             shown \\textbackslash{} answered & night\\_1 (\\%) & paper (\\%) \\\\\n\\midrule\n\
             50\\% \\& \\textless{}more\\textgreater{} & 62.5 $\\pm$ 17.7 (75.0) & 93.8 \\\\\n\
             none, \"at all\" & -- & -- \\\\\n\\bottomrule\n\\end{tabular}\n"
        );
        let html = table().to_html("tables");
        assert!(html.contains("<th>50% &amp; &lt;more&gt;</th><td>62.5 \u{b1} 17.7 (75.0)</td>"), "{html}");
        assert!(html.contains("href=\"tables/rates.tex\"") && html.contains("href=\"tables/rates.csv\""));
    }

    proptest! {
        /// Nothing in a name opens or ends anything of LaTeX, or begins a line.
        #[test]
        fn latex_is_balanced_whatever_names_are(name in "\\PC*|[\\\\{}$&#%_~^<>\n\r]*") {
            let escaped = latex(&name);
            // What is left when the commands that it may have are taken away has no special letter.
            let mut rest = escaped.clone();
            for command in ["textbackslash", "textasciitilde", "textasciicircum", "textless", "textgreater"] {
                rest = rest.replace(&format!("\\{command}{{}}"), "");
            }
            for text in ["$\\pm$", "\\&", "\\%", "\\$", "\\#", "\\_", "\\{", "\\}"] {
                rest = rest.replace(text, "");
            }
            prop_assert!(!rest.contains(['\\', '{', '}', '$', '&', '#', '%', '_', '~', '^', '\n', '\r']), "{escaped}");
        }
    }
}
