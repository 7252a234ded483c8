//! A table that can be sorted by any column: plain without the script that it comes with.

use super::text::{escape, ordinary};

/// Turns the headings of the table into buttons that sort it.
pub(crate) const SCRIPT: &str = include_str!("sortable.js");

/// A cell: its text, and the number that it is sorted by.
pub(crate) struct Cell {
    text: String,
    value: Option<f64>,
}

impl Cell {
    /// A text, sorted as such.
    pub(crate) fn text(text: impl Into<String>) -> Self {
        Self { text: text.into(), value: None }
    }

    /// A number as it is written; one that cannot be drawn is sorted last.
    pub(crate) fn number(value: f64, text: impl Into<String>) -> Self {
        Self { text: text.into(), value: Some(value).filter(|&value| ordinary(value)) }
    }

    /// A number where there is one, else a dash.
    pub(crate) fn optional(value: Option<f64>, write: impl Fn(f64) -> String) -> Self {
        value.map_or_else(|| Self::text("–"), |value| Self::number(value, write(value)))
    }

    fn html(&self, tag: &str) -> String {
        let value = self.value.map_or_else(String::new, |v| format!(" data-value=\"{v}\""));
        let end = tag.split(' ').next().unwrap_or(tag);
        format!("<{tag}{value}>{}</{end}>", escape(&self.text))
    }
}

/// How a column is sorted.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Order {
    /// By number, what has none at the end.
    Number,
    /// By text.
    Text,
}

/// A column: its heading, its order, and a cell for each row.
pub(crate) struct Column {
    /// Heading.
    pub(crate) name: String,
    /// Order.
    pub(crate) order: Order,
    /// Cells.
    pub(crate) cells: Vec<Cell>,
}

impl Column {
    fn heading(&self) -> String {
        let order = if self.order == Order::Number { "number" } else { "text" };
        format!("<th scope=\"col\" data-order=\"{order}\">{}</th>", escape(&self.name))
    }
}

/// The table, in a box of its own that scrolls; the first column names the rows.
pub(crate) fn sortable(title: &str, columns: &[Column]) -> String {
    let head: String = columns.iter().map(Column::heading).collect();
    let rows = columns.iter().map(|column| column.cells.len()).min().unwrap_or(0);
    let body: String = (0..rows).map(|row| format!("<tr>{}</tr>\n", cells(columns, row))).collect();
    format!(
        "<section class=\"numbers wide\"><h3>{title}</h3>\
         <div class=\"scroll tall\" tabindex=\"0\" role=\"region\" aria-label=\"{title}\">\
         <table class=\"sortable\"><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>\
         </div></section>\n",
        title = escape(title)
    )
}

fn cells(columns: &[Column], row: usize) -> String {
    let tag = |index: usize| if index == 0 { "th scope=\"row\"" } else { "td" };
    let columns = columns.iter().enumerate();
    columns.map(|(index, column)| column.cells[row].html(tag(index))).collect()
}
