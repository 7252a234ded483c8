//! A small drawing of its own height: texts and areas on a fixed width.

use super::plot::coordinate;
use super::text::escape;

/// Width of a drawing in its own units, about a phone's.
pub(crate) const WIDTH: f64 = 340.0;

/// Where a text is held.
#[derive(Clone, Copy)]
pub(crate) enum Anchor {
    /// Its left end.
    Start,
    /// Its middle.
    Middle,
    /// Its right end.
    End,
}

/// A drawing under construction.
#[derive(Default)]
pub(crate) struct Sheet {
    body: String,
}

impl Sheet {
    /// A text with its baseline at `y`.
    pub(crate) fn text(&mut self, class: &str, [x, y]: [f64; 2], anchor: Anchor, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        self.body += &format!(
            "<text class=\"{class}\" x=\"{}\" y=\"{}\" text-anchor=\"{anchor}\">{}</text>",
            coordinate(x),
            coordinate(y),
            escape(text)
        );
    }

    /// A rectangle between two corners, `[x0, y0, x1, y1]`.
    pub(crate) fn area(&mut self, class: &str, [x0, y0, x1, y1]: [f64; 4]) {
        let [x0, y0, x1, y1] = [x0, y0, x1, y1].map(coordinate);
        self.path(class, &format!("M{x0} {y0}H{x1}V{y1}H{x0}Z"));
    }

    /// A line from top to bottom.
    pub(crate) fn upright(&mut self, class: &str, x: f64, [from, to]: [f64; 2]) {
        let data = format!("M{} {}V{}", coordinate(x), coordinate(from), coordinate(to));
        self.path(class, &data);
    }

    /// A line from left to right with a stroke across each end.
    pub(crate) fn whisker(&mut self, class: &str, [x0, x1]: [f64; 2], y: f64) {
        let [x0, x1, y, from, to] = [x0, x1, y, y - 3.0, y + 3.0].map(coordinate);
        self.path(class, &format!("M{x0} {from}V{to}M{x0} {y}H{x1}M{x1} {from}V{to}"));
    }

    /// A mark drawn around the origin.
    pub(crate) fn mark(&mut self, [x, y]: [f64; 2], drawing: &str) {
        let (x, y) = (coordinate(x), coordinate(y));
        self.body += &format!("<g transform=\"translate({x} {y})\">{drawing}</g>");
    }

    fn path(&mut self, class: &str, data: &str) {
        self.body += &format!("<path class=\"{class}\" d=\"{data}\"/>");
    }

    /// The drawing, `height` tall; `description` is read out in its place.
    pub(crate) fn finish(self, height: f64, description: &str) -> String {
        format!(
            "<svg class=\"plot\" role=\"img\" aria-label=\"{}\" viewBox=\"0 0 {WIDTH} {}\">{}</svg>",
            escape(description),
            coordinate(height),
            self.body
        )
    }
}

/// Drawings side by side, each under a title of its own.
pub(crate) fn panels(panels: &[(String, String)]) -> String {
    let panel = |(title, drawing): &(String, String)| {
        format!("<div class=\"panel\"><h4>{}</h4>{drawing}</div>", escape(title))
    };
    let panels: String = panels.iter().map(panel).collect();
    format!("<div class=\"panels\">{panels}</div>")
}
