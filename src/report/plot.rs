//! A plot as SVG: scales, axes and marks in the coordinates of the data.

use super::span::Span;
use super::text::{escape, ordinary, shorten};
use super::ticks::{self, CHARACTER, LINE, Ticks, half, longest, thinned};

/// Width of a plot in its own units, if none is asked for; the page scales it. Narrow, so that
/// labels stay legible on a phone.
const WIDTH: f64 = 440.0;
/// Room above and to the right of the axes.
pub(crate) const MARGIN: f64 = 14.0;
/// Room below the axes, for tick labels and the name.
const FOOT: f64 = 46.0;
/// Height of the axes, at most, where both have one scale.
const HIGHEST: f64 = 480.0;
/// Characters that an axis name may take.
const NAME: usize = 44;

/// How the axes fill the plot.
#[derive(Clone, Copy)]
pub(crate) enum Proportions {
    /// All of the width, and this height.
    Free(f64),
    /// One unit as long across as upwards.
    Equal,
}

/// Name of an axis and whether its ticks draw lines across the plot.
pub(crate) struct Labels<'a> {
    /// Below the plot.
    pub(crate) x: &'a str,
    /// Left of the plot.
    pub(crate) y: &'a str,
    /// Whole numbers only along x, as for steps and rounds.
    pub(crate) whole: bool,
}

/// An axis with ticks of its own, in place of round numbers.
pub(crate) struct Axis {
    /// What it covers.
    pub(crate) span: Span,
    /// Its ticks; a label that would touch the one before it is left out.
    pub(crate) ticks: Ticks,
}

/// A plot under construction.
pub(crate) struct Plot {
    id: String,
    x: Span,
    y: Span,
    outer: f64,
    left: f64,
    width: f64,
    height: f64,
    ticks: [Option<Ticks>; 2],
    clipped: String,
    marks: String,
    foot: String,
    foot_height: f64,
}

impl Plot {
    /// An empty plot; `id` names its clip path and is unique in the page.
    pub(crate) fn new(id: &str, x: Span, y: Span, shape: Proportions) -> Self {
        Self::across_width(id, x, y, shape, WIDTH)
    }

    /// An empty plot that is `outer` wide with its labels.
    pub(crate) fn across_width(id: &str, x: Span, y: Span, shape: Proportions, outer: f64) -> Self {
        let (mut x, mut y) = (x.widened(0.0), y.widened(0.0));
        let room = |y: Span, height: f64| room(&ticks::up(y, height));
        let across = outer - MARGIN - room(y, 400.0);
        // The label at the right end of the axis has its middle there.
        let right = MARGIN.max(CHARACTER / 2.0 * longest(&ticks::across(x, across)));
        let (mut width, mut height) = (across + MARGIN - right, 0.0);
        match shape {
            Proportions::Free(fixed) => height = fixed,
            Proportions::Equal => {
                let scale = (width / x.width()).min(HIGHEST / y.width());
                // A sliver would be unreadable: show more of the shorter axis instead.
                x = x.stretched(width * 0.5 / scale);
                y = y.stretched(width * 0.5 / scale);
                (width, height) = (width.min(scale * x.width()), scale * y.width() + height);
            }
        }
        let left = room(y, height);
        let spare = outer - right - left - width;
        Self {
            id: id.to_owned(),
            x,
            y,
            outer,
            left: left + spare.max(0.0) / 2.0,
            width: width + spare.min(0.0),
            height,
            ticks: [None, None],
            clipped: String::new(),
            marks: String::new(),
            foot: String::new(),
            foot_height: 0.0,
        }
    }

    /// An empty plot between two axes of their own; `right` is left free beside it.
    pub(crate) fn ticked(id: &str, axes: [Axis; 2], height: f64, [outer, right]: [f64; 2]) -> Self {
        let [x, y] = axes;
        let left = room(&y.ticks);
        let empty = Self::across_width(id, x.span, y.span, Proportions::Free(height), outer);
        let last = x.ticks.last().map_or(0.0, |(_, text)| half(text));
        let width = outer - left - (MARGIN + right).max(last);
        let mut plot = Self { left, width, ..empty };
        let across = |tick: f64, text: &str| {
            [plot.across(tick) - half(text), plot.across(tick) + half(text) + 4.0]
        };
        let up = |tick: f64, _: &str| [-plot.down(tick), LINE - plot.down(tick)];
        // The labels along x keep clear of those along y.
        let x = thinned(x.ticks, left - 7.0, across);
        let y = thinned(y.ticks, f64::NEG_INFINITY, up);
        plot.ticks = [Some(x), Some(y)];
        plot
    }

    /// Where `x` lies across the plot.
    pub(crate) fn across(&self, x: f64) -> f64 {
        self.left + self.width * (x - self.x.low) / self.x.width()
    }

    /// Where `y` lies down the plot.
    pub(crate) fn down(&self, y: f64) -> f64 {
        MARGIN + self.height * (self.y.high - y) / self.y.width()
    }

    /// Length of a data distance across and down.
    pub(crate) fn lengths(&self, distance: f64) -> [f64; 2] {
        [distance * self.width / self.x.width(), distance * self.height / self.y.width()]
    }

    /// Path data through `points`; breaks where a point cannot be drawn.
    pub(crate) fn line(&self, points: impl IntoIterator<Item = [f64; 2]>) -> String {
        let mut path = String::new();
        let mut pen = 'M';
        for [x, y] in points {
            if ordinary(x) && ordinary(y) {
                path +=
                    &format!("{pen}{} {}", coordinate(self.across(x)), coordinate(self.down(y)));
                pen = 'L';
            } else {
                pen = 'M';
            }
        }
        path
    }

    /// Path data of a closed polygon.
    pub(crate) fn polygon(&self, points: impl IntoIterator<Item = [f64; 2]>) -> String {
        self.line(points) + "Z"
    }

    /// Path data of a rectangle between two corners.
    pub(crate) fn rectangle(&self, [x0, y0, x1, y1]: [f64; 4]) -> String {
        self.polygon([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    }

    /// Whether it goes beyond these spans, by as much as is seen.
    pub(crate) fn exceeds(&self, spans: [Span; 2]) -> bool {
        let seen = |own: Span, known: Span| {
            (known.low - own.low).max(own.high - known.high) > 1e-3 * own.width()
        };
        seen(self.x, spans[0]) || seen(self.y, spans[1])
    }

    /// Covers what lies beyond these spans, of which nothing is known.
    pub(crate) fn beyond(&mut self, [x, y]: [Span; 2]) {
        let all = self.rectangle([self.x.low, self.y.low, self.x.high, self.y.high]);
        let known = self.rectangle([x.low, y.low, x.high, y.high]);
        self.path("beyond", &(all + &known));
    }

    /// Draws path data inside the axes.
    pub(crate) fn path(&mut self, class: &str, data: &str) {
        if !data.is_empty() {
            self.clipped += &format!("<path class=\"{class}\" d=\"{data}\"/>");
        }
    }

    /// Draws a fragment in the units of the plot, inside the axes.
    pub(crate) fn fragment(&mut self, drawing: &str) {
        self.clipped += drawing;
    }

    /// Draws an ellipse with its half axes in plot units, inside the axes.
    pub(crate) fn ellipse(&mut self, class: &str, [x, y]: [f64; 2], [rx, ry]: [f64; 2]) {
        if ordinary(x) && ordinary(y) && ordinary(rx) && ordinary(ry) {
            self.clipped += &format!(
                "<ellipse class=\"{class}\" cx=\"{}\" cy=\"{}\" rx=\"{}\" ry=\"{}\"/>",
                coordinate(self.across(x)),
                coordinate(self.down(y)),
                coordinate(rx),
                coordinate(ry)
            );
        }
    }

    /// Puts a mark, drawn around the origin, at a point of the plot; nothing outside the axes.
    pub(crate) fn mark(&mut self, point: [f64; 2], drawing: &str) {
        let mark = self.placed(point, drawing);
        self.marks += &mark;
    }

    /// Puts a mark under the paths that are drawn after it.
    pub(crate) fn speck(&mut self, point: [f64; 2], drawing: &str) {
        let mark = self.placed(point, drawing);
        self.clipped += &mark;
    }

    /// Puts a mark right of the axes, at a height of the plot.
    pub(crate) fn beside(&mut self, down: f64, drawing: &str) {
        let (across, down) = (coordinate(self.left + self.width + 6.0), coordinate(down));
        self.marks += &format!("<g transform=\"translate({across} {down})\">{drawing}</g>");
    }

    fn placed(&self, [x, y]: [f64; 2], drawing: &str) -> String {
        let within = |span: Span, value: f64| {
            let slack = 1e-9 * span.width();
            value >= span.low - slack && value <= span.high + slack
        };
        if !within(self.x, x) || !within(self.y, y) {
            return String::new();
        }
        let (across, down) = (coordinate(self.across(x)), coordinate(self.down(y)));
        format!("<g transform=\"translate({across} {down})\">{drawing}</g>")
    }

    /// A strip below the axes, `height` tall, drawn from its upper left corner, `width` wide.
    pub(crate) fn strip(&mut self, height: f64, draw: impl FnOnce(f64) -> String) {
        let (left, top) = (coordinate(self.left), coordinate(MARGIN + self.height + FOOT));
        let drawing = draw(self.width);
        self.foot = format!("<g transform=\"translate({left} {top})\">{drawing}</g>");
        self.foot_height = height;
    }

    /// The whole drawing; `description` is read out in its place.
    pub(crate) fn finish(self, labels: &Labels, description: &str) -> String {
        let [left, right] = [self.left, self.left + self.width].map(coordinate);
        let [top, bottom] = [MARGIN, MARGIN + self.height].map(coordinate);
        let [width, height] = [self.width, self.height].map(coordinate);
        let total = coordinate(MARGIN + self.height + FOOT + self.foot_height);
        let id = &self.id;
        format!(
            "<svg class=\"plot\" role=\"img\" aria-label=\"{description}\" \
             viewBox=\"0 0 {outer} {total}\">\
             <clipPath id=\"{id}-clip\"><path d=\"M{left} {top}H{right}V{bottom}H{left}Z\"/></clipPath>\
             {axes}<g clip-path=\"url(#{id}-clip)\">{clipped}</g>\
             <rect class=\"frame\" x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\"/>\
             {marks}{foot}</svg>",
            outer = coordinate(self.outer),
            description = escape(description),
            axes = self.axes(labels),
            clipped = self.clipped,
            marks = self.marks,
            foot = self.foot,
        )
    }

    fn axes(&self, labels: &Labels) -> String {
        let mut axes = String::new();
        for (tick, text) in self.x_ticks(labels) {
            let at = self.across(tick);
            let [line, from, to] = [at, MARGIN, MARGIN + self.height + 4.0].map(coordinate);
            axes += &format!("<path class=\"grid\" d=\"M{line} {from}V{to}\"/>");
            let held = at.min(self.outer - half(&text)).max(half(&text));
            axes += &tick_label([held, MARGIN + self.height + 17.0], "middle", &text);
        }
        for (tick, text) in self.y_ticks() {
            let at = self.down(tick);
            let [line, from, to] = [at, self.left - 4.0, self.left + self.width].map(coordinate);
            axes += &format!("<path class=\"grid\" d=\"M{from} {line}H{to}\"/>");
            axes += &tick_label([self.left - 7.0, at + 4.0], "end", &text);
        }
        axes + &self.names(labels)
    }

    fn x_ticks(&self, labels: &Labels) -> Ticks {
        let round = if labels.whole { ticks::whole } else { ticks::across };
        self.ticks[0].clone().unwrap_or_else(|| round(self.x, self.width))
    }

    fn y_ticks(&self) -> Ticks {
        self.ticks[1].clone().unwrap_or_else(|| ticks::up(self.y, self.height))
    }

    fn names(&self, labels: &Labels) -> String {
        let [x, y] = [labels.x, labels.y].map(|name| escape(&shorten(name, NAME)));
        let bottom = MARGIN + self.height;
        let (middle, half) = (self.left + self.width / 2.0, MARGIN + self.height / 2.0);
        // A long name of a low plot is squeezed into its height.
        let long = 6.6 * labels.y.chars().count().min(NAME) as f64 > self.height;
        let squeeze = if long {
            format!(" textLength=\"{}\" lengthAdjust=\"spacingAndGlyphs\"", coordinate(self.height))
        } else {
            String::new()
        };
        let longest = self.left - 15.0 - CHARACTER * longest(&self.y_ticks());
        format!(
            "<text class=\"name\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">{x}</text>\
             <text class=\"name\" transform=\"translate({} {}) rotate(-90)\" \
             text-anchor=\"middle\"{squeeze}>{y}</text>",
            coordinate(middle),
            coordinate(bottom + 37.0),
            coordinate(longest.max(12.0)),
            coordinate(half)
        )
    }
}

/// What stands at a tick; nothing where its label was left out.
fn tick_label([x, y]: [f64; 2], anchor: &str, text: &str) -> String {
    if text.is_empty() {
        return String::new();
    }
    let (x, y, text) = (coordinate(x), coordinate(y), escape(text));
    format!("<text class=\"tick\" x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{text}</text>")
}

/// Room left of the axes for the labels and the name.
fn room(ticks: &Ticks) -> f64 {
    32.0 + CHARACTER * longest(ticks)
}

/// A coordinate of the drawing, to a hundredth; far points are brought near, outside the axes.
pub(crate) fn coordinate(value: f64) -> String {
    let value = if value.is_nan() { 0.0 } else { value.clamp(-1e4, 1e4) };
    let text = format!("{value:.2}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::{Labels, Plot, Proportions, coordinate};
    use crate::report::span::Span;

    #[test]
    fn an_equal_plot_has_one_scale() {
        let (x, y) = (Span { low: -1.0, high: 1.0 }, Span { low: 0.0, high: 3.0 });
        let plot = Plot::new("p", x, y, Proportions::Equal);
        let [across, down] = plot.lengths(1.0);
        assert!((across - down).abs() < 1e-9);
    }

    #[test]
    fn nothing_that_is_not_finite_reaches_the_drawing() {
        let point = Span::of([f64::NAN, 2.0, 1e30]).expect("2 is a number");
        assert_eq!(point, Span { low: 2.0, high: 2.0 });
        assert_eq!(Span::of([f64::NAN]), None);
        let mut plot = Plot::new("p", point, point, Proportions::Free(100.0));
        let line = plot.line([[2.0, 2.0], [f64::NAN, 2.0], [2.0, 1e30], [2.0, 2.0]]);
        assert_eq!(line.matches('M').count(), 2);
        plot.path("line", &line);
        plot.mark([f64::NAN, 2.0], "never");
        plot.ellipse("line", [2.0, f64::INFINITY], [1.0, 1.0]);
        let labels = Labels { x: "x", y: "y", whole: false };
        let drawing = plot.finish(&labels, "a point");
        assert!(!drawing.contains("NaN") && !drawing.contains("inf") && !drawing.contains("never"));
        assert_eq!(coordinate(f64::NAN), "0");
        assert_eq!(coordinate(-0.001), "0");
        assert_eq!(coordinate(1e300), "10000");
    }
}
