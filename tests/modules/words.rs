//! The words of a source text, and the paths among them.

use std::str::FromStr;

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// A path that a file names.
#[derive(Debug)]
pub(super) struct Mention {
    /// Its names.
    pub(super) path: Vec<String>,
    /// What the file calls it, where it imports it.
    pub(super) name: Option<String>,
    /// Whether the file hands it on to others.
    pub(super) handed_on: bool,
}

/// The words of `text` without comments, tests and the places of `pub(in ..)`; literals are empty.
pub(super) fn words(file: &str, text: &str) -> Vec<String> {
    let tokens = TokenStream::from_str(text).unwrap_or_else(|e| panic!("{file}: {e}"));
    let mut words = Vec::new();
    flatten(tokens, &mut words);
    without_tests(&words)
}

fn flatten(tokens: TokenStream, out: &mut Vec<String>) {
    for token in tokens {
        match token {
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::None => ("", ""),
                };
                out.push(open.to_owned());
                flatten(group.stream(), out);
                out.push(close.to_owned());
            }
            TokenTree::Ident(word) => out.push(word.to_string()),
            TokenTree::Literal(_) => out.push(String::new()),
            TokenTree::Punct(point) => match (out.last_mut(), point.as_char()) {
                (Some(last), ':') if last == ":" => last.push(':'),
                (_, point) => out.push(point.to_string()),
            },
        }
    }
}

/// `words` without what only tests are compiled with, and without the places that things are
/// visible in, which nobody imports.
fn without_tests(words: &[String]) -> Vec<String> {
    let mut left = Vec::new();
    let mut at = 0;
    while at < words.len() {
        let begins = |pattern: &[&str]| {
            words[at..].iter().map(String::as_str).take(pattern.len()).eq(pattern.iter().copied())
        };
        let of_test = begins(&["#", "[", "cfg", "(", "test", ")"])
            || begins(&["#", "[", "cfg", "(", "all", "(", "test"]);
        if of_test {
            at = end_of_item(words, end_of_group(words, at + 1));
        } else if begins(&["pub", "(", "in"]) {
            left.push("pub".to_owned());
            at = end_of_group(words, at + 1);
        } else {
            left.push(words[at].clone());
            at += 1;
        }
    }
    left
}

/// Behind the group that begins at `at`.
fn end_of_group(words: &[String], mut at: usize) -> usize {
    let mut depth = 0;
    loop {
        match words[at].as_str() {
            "{" | "[" | "(" => depth += 1,
            "}" | "]" | ")" => depth -= 1,
            _ => {}
        }
        at += 1;
        if depth == 0 {
            return at;
        }
    }
}

/// Behind the item that begins at `at`: its braces, or a semicolon.
fn end_of_item(words: &[String], mut at: usize) -> usize {
    loop {
        match words[at].as_str() {
            ";" => return at + 1,
            "{" => return end_of_group(words, at),
            "[" | "(" => at = end_of_group(words, at),
            _ => at += 1,
        }
    }
}

/// Every path among `words`: imports, and those with two names or more that stand in the code.
pub(super) fn mentions(words: &[String]) -> Vec<Mention> {
    let mut found = Vec::new();
    let mut at = 0;
    while at < words.len() {
        let inside = at > 0 && words[at - 1] == "::";
        let import = words[at] == "use";
        let handed_on = import && at > 0 && (words[at - 1] == "pub" || words[at - 1] == ")");
        let path = is_name(&words[at]) && words.get(at + 1).is_some_and(|next| next == "::");
        if import || (path && !inside) {
            let mut tree = Tree { words, at: at + usize::from(import), import, handed_on, found };
            tree.branch(&mut Vec::new());
            (at, found) = (tree.at, tree.found);
        } else {
            at += 1;
        }
    }
    found
}

fn is_name(word: &str) -> bool {
    word.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
}

/// A path with its lists, read word by word.
struct Tree<'a> {
    words: &'a [String],
    at: usize,
    import: bool,
    handed_on: bool,
    found: Vec<Mention>,
}

impl Tree<'_> {
    fn word(&self) -> &str {
        self.words.get(self.at).map_or("", String::as_str)
    }

    /// Reads what follows the names of `path`.
    fn branch(&mut self, path: &mut Vec<String>) {
        if self.import && self.word() == "{" {
            return self.list(path);
        }
        let word = self.word().to_owned();
        self.at += 1;
        path.push(word);
        let next = self.words.get(self.at + 1).map_or("", String::as_str);
        let goes_on = is_name(next) || (self.import && (next == "{" || next == "*"));
        if self.word() == "::" && goes_on {
            self.at += 1;
            self.branch(path);
        } else {
            self.leaf(path);
        }
        path.pop();
    }

    /// Reads a list in braces.
    fn list(&mut self, path: &mut Vec<String>) {
        self.at += 1;
        while self.word() != "}" {
            self.branch(path);
            if self.word() == "," {
                self.at += 1;
            }
        }
        self.at += 1;
    }

    /// Notes the path that ends here.
    fn leaf(&mut self, path: &[String]) {
        let mut path = path.to_vec();
        if path.len() > 1 && path.last().is_some_and(|word| word == "self") {
            path.pop();
        }
        let mut name = path.last().cloned();
        if self.import && self.word() == "as" {
            name = self.words.get(self.at + 1).cloned();
            self.at += 2;
        }
        let name = name.filter(|_| self.import);
        self.found.push(Mention { path, name, handed_on: self.handed_on });
    }
}
