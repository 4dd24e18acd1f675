//! Parts of charts as SVG, colored by the style sheet of the page so that they follow light and dark.
//!
//! All are in the same coordinates: a plot [`PLOT_HEIGHT`] high that begins at [`LEFT`] and [`TOP`] in a
//! picture [`WIDTH`] wide.

use super::escape;

/// How wide a picture is.
pub const WIDTH: f64 = 860.0;
/// Where the plot begins, right of the labels of its y axis.
pub const LEFT: f64 = 40.0;
/// Where the plot begins, below the legend.
pub const TOP: f64 = 30.0;
/// How high the plot is.
pub const PLOT_HEIGHT: f64 = 220.0;
/// The style sheet has as many colors, as the classes `f0` and on for areas, `l0` and on for lines.
pub const N_COLORS: usize = 8;

/// Where a share of the plot's height stands, 0 to 1 from its foot.
pub fn y_of(share: f64) -> f64 {
    TOP + PLOT_HEIGHT * (1.0 - share.clamp(0.0, 1.0))
}

/// The y axis of rates, 0 to 1.
pub fn rate_axis() -> String {
    y_axis((0..=10).step_by(2).map(|tenth| {
        let rate = f64::from(tenth) / 10.0;
        (rate, format!("{rate:.1}"))
    }))
}

/// A y axis with grid lines at shares of the plot's height and their labels.
pub fn y_axis(ticks: impl Iterator<Item = (f64, String)>) -> String {
    let line = |(share, text): (f64, String)| {
        let y = y_of(share);
        format!(
            "<line class=\"grid\" x1=\"{LEFT}\" x2=\"{WIDTH}\" y1=\"{y:.1}\" y2=\"{y:.1}\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n",
            LEFT - 6.0,
            y + 4.0,
            escape(&text)
        )
    };
    ticks.map(line).collect()
}

/// A line through points of the picture.
pub fn polyline(color: usize, points: impl Iterator<Item = (f64, f64)>) -> String {
    let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
    format!("<polyline class=\"l{}\" points=\"{}\"/>\n", color % N_COLORS, points.join(" "))
}

/// Text round a place on the x axis, moved so far that it stays in the picture.
pub fn label(x: f64, y: f64, text: &str) -> String {
    let half = text_width(text) / 2.0;
    let x = x.min(WIDTH - half).max(half);
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"middle\">{}</text>\n", escape(text))
}

/// Names beside their colors, the first color first.
pub fn legend(names: &[&str]) -> String {
    let mut x = LEFT;
    let mut svg = String::new();
    for (idx, name) in names.iter().enumerate() {
        svg += &format!(
            "<rect class=\"f{}\" x=\"{x:.1}\" y=\"6\" width=\"10\" height=\"10\"/>\
             <text x=\"{:.1}\" y=\"15\">{}</text>\n",
            idx % N_COLORS,
            x + 14.0,
            escape(name)
        );
        x += 34.0 + text_width(name);
    }
    svg
}

/// A picture of this height around its content.
pub fn framed(content: &str, height: f64) -> String {
    format!("<svg viewBox=\"0 0 {WIDTH} {height:.0}\" width=\"{WIDTH}\" role=\"img\">\n{content}</svg>\n")
}

/// About how wide a text is.
fn text_width(text: &str) -> f64 {
    6.5 * text.chars().count() as f64
}
