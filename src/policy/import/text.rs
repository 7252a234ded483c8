//! Texts of numbers: words one after the other, read as what is asked for.

/// Most numbers between two layers in a text.
const WIDEST: usize = 1 << 20;

/// The words of a text, and where one is.
#[derive(Debug)]
pub(super) struct Words<'a> {
    words: Vec<&'a str>,
    at: usize,
}

/// Whether the file is a text that begins with two lines of a whole number each.
pub(super) fn is_numbers(bytes: &[u8]) -> bool {
    let text = std::str::from_utf8(bytes.get(..64).unwrap_or(bytes)).unwrap_or_default();
    let mut lines = text.lines().map(|line| line.trim().parse::<u32>());
    matches!((lines.next(), lines.next()), (Some(Ok(_)), Some(Ok(_))))
}

impl<'a> Words<'a> {
    /// The words of `bytes`, separated by blanks, commas and lines; what follows `//` is a comment.
    ///
    /// # Errors
    /// A sentence about bytes that are no text.
    pub(super) fn of(bytes: &'a [u8]) -> Result<Self, String> {
        let text = std::str::from_utf8(bytes).map_err(|_| "no text in UTF-8")?;
        let lines = text.lines().map(|line| line.split_once("//").map_or(line, |(line, _)| line));
        let words = lines.flat_map(|line| line.split(|c: char| c == ',' || c.is_whitespace()));
        Ok(Self { words: words.filter(|word| !word.is_empty()).collect(), at: 0 })
    }

    /// The next word, which is called `what` in messages.
    ///
    /// # Errors
    /// A sentence if there is none.
    pub(super) fn word(&mut self, what: &str) -> Result<&'a str, String> {
        let word = self.words.get(self.at).ok_or_else(|| {
            format!("cut off: {what} is missing behind its {} words", self.words.len())
        })?;
        self.at += 1;
        Ok(word)
    }

    /// The next word as a number of neurons or layers.
    ///
    /// # Errors
    /// A sentence that shows the word.
    pub(super) fn count(&mut self, what: &str) -> Result<usize, String> {
        let word = self.word(what)?;
        let count = word.parse().ok().filter(|count| (1..=WIDEST).contains(count));
        count.ok_or_else(|| {
            format!("word {}, {what}: `{word}` is no whole number from 1 to {WIDEST}", self.at)
        })
    }

    /// The next word as a number.
    ///
    /// # Errors
    /// As [`Words::count`].
    pub(super) fn number(&mut self, what: &str) -> Result<f64, String> {
        let word = self.word(what)?;
        let number = word.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| format!("word {}, {what}: `{word}` is no finite number", self.at))
    }

    /// The next `count` words as numbers.
    ///
    /// # Errors
    /// As [`Words::number`].
    pub(super) fn numbers(&mut self, count: usize, what: &str) -> Result<Vec<f64>, String> {
        // No room is made beforehand for what a file only claims to have.
        (0..count).map(|_| self.number(what)).collect()
    }

    /// Whether the next word is no number.
    pub(super) fn is_word(&self) -> bool {
        self.words.get(self.at).is_some_and(|word| word.parse::<f64>().is_err())
    }

    /// Words that are left.
    pub(super) fn left(&self) -> usize {
        self.words.len() - self.at
    }
}
