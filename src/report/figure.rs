//! A figure of the page: title, drawing, legend and caption.

use super::text::escape;

/// One figure; `drawing` is SVG, every other text is escaped here.
pub(crate) struct Figure {
    /// Anchor, unique in the page.
    pub(crate) id: &'static str,
    /// Title.
    pub(crate) title: String,
    /// The drawing, or why there is none.
    pub(crate) drawing: Result<String, String>,
    /// Swatches and what they stand for.
    pub(crate) legend: Vec<(Swatch, String)>,
    /// What the figure shows and how to read it.
    pub(crate) caption: String,
}

/// What a legend shows beside a name.
pub(crate) enum Swatch {
    /// A line of these classes.
    Line(&'static str),
    /// An area of these classes.
    Area(&'static str),
    /// A mark drawn around the origin.
    Mark(String),
    /// A line with a mark in its middle.
    Marked(&'static str, String),
}

impl Swatch {
    fn svg(&self) -> String {
        let line = |class: &str| format!("<path class=\"{class}\" d=\"M1 8H31\"/>");
        let mark = |drawing: &str| format!("<g transform=\"translate(16 8)\">{drawing}</g>");
        let drawing = match self {
            Self::Line(class) => line(class),
            Self::Area(class) => format!("<path class=\"{class}\" d=\"M2 1.5H30V14.5H2Z\"/>"),
            Self::Mark(drawing) => mark(drawing),
            Self::Marked(class, drawing) => line(class) + &mark(drawing),
        };
        format!("<svg class=\"swatch\" viewBox=\"0 0 32 16\" aria-hidden=\"true\">{drawing}</svg>")
    }
}

impl Figure {
    /// The figure as HTML.
    pub(crate) fn html(&self) -> String {
        let drawing = match &self.drawing {
            Ok(drawing) => drawing.clone(),
            Err(reason) => format!("<p class=\"empty\">{}</p>", escape(reason)),
        };
        let legend: String = self
            .legend
            .iter()
            .map(|(swatch, name)| format!("<li>{}<span>{}</span></li>", swatch.svg(), escape(name)))
            .collect();
        let legend =
            if legend.is_empty() { legend } else { format!("<ul class=\"legend\">{legend}</ul>") };
        format!(
            "<figure class=\"card\" id=\"{}\"><h3>{}</h3>{drawing}{legend}\
             <figcaption>{}</figcaption></figure>\n",
            self.id,
            escape(&self.title),
            escape(&self.caption)
        )
    }
}

/// The state from which slice and growth start: a diamond with a halo.
pub(crate) fn diamond() -> String {
    "<path class=\"halo\" d=\"M0-7L6 0L0 7L-6 0Z\"/><path class=\"state\" d=\"M0-7L6 0L0 7L-6 0Z\"/>"
        .to_owned()
}

/// A failure.
pub(crate) fn cross(size: f64) -> String {
    let path = format!("M-{size}-{size}L{size} {size}M-{size} {size}L{size}-{size}");
    format!("<path class=\"halo thin\" d=\"{path}\"/><path class=\"bad-line\" d=\"{path}\"/>")
}

/// A success.
pub(crate) fn dot(size: f64) -> String {
    format!("<circle class=\"good\" r=\"{size}\"/>")
}
