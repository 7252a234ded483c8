//! What all pages share: the head of the document, styles, patterns, lists.

use super::text::escape;
use crate::backend::Event;
use crate::scenario::record::Provenance;

/// The style of every page.
const STYLE: &str = include_str!("style.css");
/// The pattern of violated constraints, shared by all figures.
pub(crate) const HATCH: &str = "<svg class=\"defs\" aria-hidden=\"true\"><defs>\
    <pattern id=\"hatch\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\">\
    <path d=\"M-1.5 1.5L1.5-1.5M0 6L6 0M4.5 7.5L7.5 4.5\"/></pattern></defs></svg>\n";
/// The style of panels of small drawings, for the pages that have them.
pub(crate) const SHEET_STYLE: &str = include_str!("sheet.css");
/// The patterns that tell classes and tiers apart without colour.
pub(crate) const WEAVES: &str = "<svg class=\"defs\" aria-hidden=\"true\"><defs>\
    <pattern id=\"rising\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\">\
    <path d=\"M-1.5 1.5L1.5-1.5M0 6L6 0M4.5 7.5L7.5 4.5\"/></pattern>\
    <pattern id=\"falling\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\">\
    <path d=\"M-1.5 4.5L1.5 7.5M0 0L6 6M4.5-1.5L7.5 1.5\"/></pattern>\
    <pattern id=\"level\" width=\"5\" height=\"5\" patternUnits=\"userSpaceOnUse\">\
    <path d=\"M0 2.5H5\"/></pattern>\
    <pattern id=\"upright\" width=\"5\" height=\"5\" patternUnits=\"userSpaceOnUse\">\
    <path d=\"M2.5 0V5\"/></pattern>\
    <pattern id=\"dotted\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\">\
    <circle cx=\"1.5\" cy=\"1.5\" r=\"1\"/><circle cx=\"4.5\" cy=\"4.5\" r=\"1\"/></pattern>\
    </defs></svg>\n";

/// ` of ` and the plant that a configuration names; nothing where it names none.
pub(crate) fn of_plant(provenance: &Provenance) -> String {
    let named = |place: &str| provenance.config.pointer(place)?.as_str();
    let name = named("/model/name").or_else(|| named("/system/name"));
    name.map_or_else(String::new, |name| format!(" of {name}"))
}

/// Which scripts a page allows to run.
#[derive(Clone, Copy)]
pub(crate) enum Scripts {
    /// None at all.
    None,
    /// Those in the page itself.
    Own,
}

/// The head of a document that loads nothing; `styles` follow the style of every page.
pub(crate) fn head(title: &str, styles: &str, scripts: Scripts) -> String {
    let scripts = match scripts {
        Scripts::None => "",
        Scripts::Own => "script-src 'unsafe-inline'; ",
    };
    format!(
        "<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
         style-src 'unsafe-inline'; {scripts}img-src data:\">\n\
         <link rel=\"icon\" href=\"data:,\">\n\
         <title>Reachcast: {}</title>\n<style>\n{STYLE}{styles}</style>\n</head>\n",
        escape(title)
    )
}

/// An outcome that leads the page.
pub(crate) struct Headline {
    /// Whose, and of what.
    pub(crate) title: String,
    /// The outcome.
    pub(crate) value: String,
    /// What belongs to it, one sentence each.
    pub(crate) details: Vec<String>,
}

/// The card of a headline.
pub(crate) fn card(headline: &Headline) -> String {
    let details = headline.details.iter().map(|text| format!("<p>{}</p>", escape(text)));
    format!(
        "<section class=\"card claim\"><h2>{}</h2><p class=\"headline\">{}</p>{}</section>\n",
        escape(&headline.title),
        escape(&headline.value),
        details.collect::<String>()
    )
}

/// The foot of the page, with what it says of repeated runs.
pub(crate) fn footer(provenance: &Provenance, repeated: &str) -> String {
    let version = escape(&provenance.version);
    format!("<footer>Written by reachcast {version} from one record; {repeated}.</footer>\n")
}

/// What failed on the adapter and was worked around; nothing where nothing did.
pub(crate) fn failures(events: &[Event]) -> String {
    if events.is_empty() {
        return String::new();
    }
    let texts: Vec<String> = events.iter().map(Event::to_string).collect();
    format!(
        "<section class=\"card limits\" aria-labelledby=\"adapter\">\
         <h2 id=\"adapter\">What failed on the adapter</h2>\n<ol>\n{}</ol>\n\
         <p>Nothing was lost or counted twice; results from the CPU agree with those of the adapter up \
         to rounding.</p></section>\n",
        items(&texts)
    )
}

/// What has to be said beside the figures; nothing where there is nothing.
pub(crate) fn notes(notes: &[String]) -> String {
    if notes.is_empty() {
        return String::new();
    }
    format!(
        "<div class=\"words\"><section class=\"card limits\" aria-labelledby=\"notes\">\
         <h2 id=\"notes\">To be kept in mind</h2>\n<ul>\n{}</ul></section></div>\n",
        items(notes)
    )
}

/// The items of a list.
pub(crate) fn items(texts: &[String]) -> String {
    texts.iter().map(|text| format!("<li>{}</li>\n", escape(text))).collect()
}

/// The configuration, folded away.
pub(crate) fn configuration(provenance: &Provenance) -> String {
    let config = serde_json::to_string_pretty(&provenance.config).unwrap_or_default();
    format!(
        "<details><summary>Configuration with every default</summary>\n\
         <pre tabindex=\"0\">{}</pre></details>",
        escape(&config)
    )
}
