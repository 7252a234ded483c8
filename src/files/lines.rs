//! The lines of a .csv file as rows of numbers, whatever separates them and whoever named the columns.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};

/// Longest line, bytes.
const LONGEST_LINE: u64 = 65_536;
/// What the name of a column has that is a note beside the states.
const NOTE: char = ':';
/// First bytes of a text in UTF-16, as some spreadsheets save it.
const UTF16: [[u8; 2]; 2] = [[0xff, 0xfe], [0xfe, 0xff]];

/// Rows of numbers, one for each name, from lines of text.
#[derive(Debug)]
pub(super) struct Lines {
    file: BufReader<File>,
    /// Lines read.
    number: u64,
    /// What separates fields, once a line has shown it.
    separator: Option<char>,
    /// For each field the place of its number in the row, none where it is no state, once that is settled.
    order: Option<Vec<Option<usize>>>,
}

impl Lines {
    /// The lines of `file` from where it stands.
    pub(super) fn new(file: BufReader<File>) -> Self {
        Self { file, number: 0, separator: None, order: None }
    }

    /// Fills `row` from the next line with numbers; `names` say what they are. False at the end.
    ///
    /// A header, plain or after `#`, puts the columns in order; other lines that begin with `#`, and
    /// blank ones, are left out.
    ///
    /// # Errors
    /// A sentence that names the line and what is wrong with it.
    pub(super) fn next(&mut self, row: &mut [f32], names: &[String]) -> Result<bool, String> {
        loop {
            let Some(line) = self.line()? else { return Ok(false) };
            let text = line.trim();
            let comment = text.strip_prefix('#').map(str::trim);
            let content = comment.unwrap_or(text);
            if content.is_empty() {
                continue;
            }
            let separator = self.separator.unwrap_or_else(|| separator(content));
            let Some(fields) = split(content, separator) else {
                // An apostrophe or a quote in a comment is no field.
                match comment {
                    Some(_) => continue,
                    None => return Err(format!("line {}: a quote is not closed", self.number)),
                }
            };
            if comment.is_some() && !names_states(&fields, names, separator) {
                continue;
            }
            self.separator = Some(separator);
            match &self.order {
                None if comment.is_some() || is_header(&fields) => {
                    self.order = Some(order(&fields, names)?);
                }
                None => {
                    self.refuse_numbered(&fields, names)?;
                    self.order = Some((0..names.len()).map(Some).collect());
                    return self.parse(&fields, row, names).map(|()| true);
                }
                // A header again, above the second of two files that were put together.
                Some(_) if comment.is_some() => self.same_order(&fields, names)?,
                Some(_) => return self.parse(&fields, row, names).map(|()| true),
            }
        }
    }

    /// The next line; none at the end.
    fn line(&mut self) -> Result<Option<String>, String> {
        let mut bytes = Vec::new();
        let limited = &mut self.file.by_ref().take(LONGEST_LINE);
        let length = limited.read_until(b'\n', &mut bytes).map_err(|e| e.to_string())?;
        if length == 0 {
            return Ok(None);
        }
        self.number += 1;
        let number = self.number;
        if number == 1 && UTF16.iter().any(|mark| bytes.starts_with(mark)) {
            return Err("the text is UTF-16; save it as UTF-8".to_owned());
        }
        if length as u64 == LONGEST_LINE {
            return Err(format!("line {number} is longer than {LONGEST_LINE} bytes"));
        }
        let text = String::from_utf8(bytes);
        let text = text.map_err(|_| format!("line {number} is no text in UTF-8"))?;
        let text = if number == 1 { text.trim_start_matches('\u{feff}') } else { &text };
        if text.trim_end().contains('\r') {
            let problem = "lines end in a carriage return alone; save it with line feeds";
            return Err(format!("line {number}: {problem}"));
        }
        Ok(Some(text.to_owned()))
    }

    /// Refuses a first line that may be the numbers of the columns.
    fn refuse_numbered(&self, fields: &[String], names: &[String]) -> Result<(), String> {
        let numbered = fields.iter().enumerate().all(|(i, field)| *field == i.to_string());
        if !numbered || names.len() < 2 || fields.len() != names.len() {
            return Ok(());
        }
        let (number, line) = (self.number, fields.join(","));
        Err(format!(
            "line {number}, `{line}`, may be the numbers of the columns, which pandas writes above an \
             array, or a state: leave it out (header=False), put the names of the states there, or \
             write the state with decimal points"
        ))
    }

    /// Refuses another header than the first.
    fn same_order(&self, fields: &[String], names: &[String]) -> Result<(), String> {
        if self.order.as_ref() == Some(&order(fields, names)?) {
            return Ok(());
        }
        Err(format!("line {}: a second header, with the columns in another order", self.number))
    }

    /// The numbers of a line, each in its place of `row`.
    fn parse(&self, fields: &[String], row: &mut [f32], names: &[String]) -> Result<(), String> {
        let number = self.number;
        let in_order = (0..row.len()).map(Some).collect::<Vec<_>>();
        let places = self.order.as_ref().unwrap_or(&in_order);
        if fields.len() != places.len() {
            return Err(self.other_width(fields, places.len()));
        }
        for (place, field) in places.iter().zip(fields) {
            let Some(place) = *place else { continue };
            if field.is_empty() {
                return Err(format!("line {number}: {} is empty", names[place]));
            }
            // Through f64, as for arrays: one rounding to f32 from the number as written.
            let parsed = field.parse::<f64>();
            row[place] = parsed.map_err(|_| not_a_number(number, field))? as f32;
        }
        Ok(())
    }

    /// Why a line has not `expected` numbers.
    fn other_width(&self, fields: &[String], expected: usize) -> String {
        let (number, found) = (self.number, fields.len());
        let hint = match fields.last() {
            Some(last) if last.is_empty() => "; the line ends with a separator",
            _ if found == 2 * expected && self.separator == Some(',') => {
                "; if these are decimal commas, write points"
            }
            _ if found == expected + 1 => {
                "; if the first is the number of the row, leave it out (index=False in pandas)"
            }
            _ => "",
        };
        format!("line {number} has {found} numbers, a state has {expected}{hint}")
    }
}

/// Why `field` is no number.
fn not_a_number(line: u64, field: &str) -> String {
    let point = field.replace(',', ".");
    match point != field && point.parse::<f64>().is_ok() {
        true => format!("line {line}: `{field}` has a decimal comma; write {point}"),
        false => format!("line {line}: `{field}` is not a number"),
    }
}

/// What separates the fields of `line`: the first of these that it has outside of quotes.
fn separator(line: &str) -> char {
    let outside: String = line.split('"').step_by(2).collect();
    [';', '\t', ','].into_iter().find(|mark| outside.contains(*mark)).unwrap_or(' ')
}

/// The fields of `line`, without quotes and the blanks around them; none if a quote stays open.
fn split(line: &str, separator: char) -> Option<Vec<String>> {
    let (mut fields, mut field, mut quoted) = (Vec::new(), String::new(), false);
    for letter in line.chars() {
        match letter {
            '"' => quoted = !quoted,
            _ if letter == separator && !quoted => fields.push(std::mem::take(&mut field)),
            _ => field.push(letter),
        }
    }
    fields.push(field);
    let trimmed = fields.iter().map(|field| field.trim().to_owned());
    // Blanks separate in any number.
    let fields = trimmed.filter(|field| separator != ' ' || !field.is_empty()).collect();
    (!quoted).then_some(fields)
}

/// Whether the fields of a comment are meant as names of columns.
fn names_states(fields: &[String], names: &[String], separator: char) -> bool {
    let word = |field: &String| !field.is_empty() && !field.contains(char::is_whitespace);
    let whole = fields.len() == names.len() && names.len() > 1 && fields.iter().all(word);
    let known = fields.iter().filter(|field| names.contains(field)).count();
    // A sentence may have the name of a state between its commas, and among its words.
    whole || (separator != ' ' && known > 0 && fields.iter().all(word))
}

/// Whether the first line is one of names: none of its fields is a number, with whichever comma.
fn is_header(fields: &[String]) -> bool {
    let number = |field: &&String| field.replace(',', ".").parse::<f64>().is_ok();
    let numbers = fields.iter().filter(number).count();
    numbers == 0 || (fields[0].is_empty() && numbers + 1 == fields.len())
}

/// For each field of a header the place of the state that it names; none for a note, which has a colon
/// in its name (`measure:policy`).
fn order(fields: &[String], names: &[String]) -> Result<Vec<Option<usize>>, String> {
    let (found, expected) = (fields.join(","), names.join(","));
    let refused = |problem: String| {
        format!("header `{found}`: {problem}; expected the states `{expected}`, in any order")
    };
    let mut order = Vec::new();
    for field in fields {
        let found = names.iter().position(|name| name == field);
        if found.is_none() && field.contains(NOTE) {
            order.push(None);
            continue;
        }
        let Some(place) = found else {
            let problem = match field.as_str() {
                "" => {
                    "a column has no name (pandas writes row numbers so; index=False leaves them \
                       out)"
                        .to_owned()
                }
                _ => format!("`{field}` is no state"),
            };
            return Err(refused(problem));
        };
        if order.contains(&Some(place)) {
            return Err(refused(format!("`{field}` is there twice")));
        }
        order.push(Some(place));
    }
    match (0..names.len()).find(|place| !order.contains(&Some(*place))) {
        Some(missing) => Err(refused(format!("`{}` is missing", names[missing]))),
        None => Ok(order),
    }
}
