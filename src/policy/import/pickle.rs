//! The part of Python's pickle format that describes tensors; nothing in a file is ever executed.
//!
//! A pickle is a program for a stack machine that names Python functions and calls them. This one
//! knows the names in [`Global`], calls none of them, and refuses every other name.

use std::collections::HashMap;

use super::value::{Global, Pickle, Storage, Value, View};

/// Longest pickle, bytes: some 100,000 tensors.
const LONGEST: usize = 1 << 24;
/// Most values on the stack; Python's own writer puts 2,000 there at most.
const DEEPEST: usize = 1 << 16;
/// Longest name of a storage, bytes; PyTorch numbers them.
const LONGEST_KEY: usize = 32;
/// Most dimensions of a tensor, PyTorch's limit.
const MOST_DIMENSIONS: usize = 64;
/// What is wrong where an instruction finds too little on the stack.
const EMPTY: &str = "a value is needed where there is none";

/// A pickle that was read.
pub(super) struct Unpickled<'a> {
    /// Its containers.
    pub(super) pickle: Pickle<'a>,
    /// The value that it stands for.
    pub(super) root: Value<'a>,
}

/// Reads a pickle.
///
/// # Errors
/// A sentence with the byte at which the pickle is damaged, or asks for what is not allowed.
pub(super) fn read(bytes: &[u8]) -> Result<Unpickled<'_>, String> {
    if bytes.len() > LONGEST {
        let length = bytes.len();
        return Err(format!("{length} bytes of pickle; no state dict has more than {LONGEST}"));
    }
    let mut machine = Machine { bytes, ..Machine::default() };
    loop {
        let at = machine.at;
        match machine.step() {
            Ok(None) => {}
            Ok(Some(root)) => return Ok(Unpickled { pickle: machine.pickle, root }),
            Err(problem) => return Err(format!("pickle, byte {at}: {problem}")),
        }
    }
}

/// The stack machine.
#[derive(Default)]
struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    stack: Vec<Value<'a>>,
    /// Heights of the stack that the pickle has marked.
    marks: Vec<usize>,
    memo: HashMap<u32, Value<'a>>,
    pickle: Pickle<'a>,
}

impl<'a> Machine<'a> {
    /// One instruction; the value of the whole pickle at its end.
    fn step(&mut self) -> Result<Option<Value<'a>>, String> {
        let [code] = self.array()?;
        match code {
            0x80 => self.protocol()?,
            b'}' => self.push_dict()?,
            b']' | b'N' | 0x88 | 0x89 => self.push(Value::Other)?,
            b'G' => {
                self.take(8)?;
                self.push(Value::Other)?;
            }
            b'K' => self.number::<1>()?,
            b'M' => self.number::<2>()?,
            b'J' => {
                let number = i32::from_le_bytes(self.array()?);
                self.push(Value::Int(number.into()))?;
            }
            0x8a => self.long()?,
            b'X' => {
                let length = u32::from_le_bytes(self.array()?);
                let text = std::str::from_utf8(self.take(length as usize)?);
                self.push(Value::Text(text.map_err(|_| "a text that is not UTF-8")?))?;
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(Value::Global(Global::find(module, name)?))?;
            }
            b'q' => self.remember::<1>()?,
            b'r' => self.remember::<4>()?,
            b'h' => self.recall::<1>()?,
            b'j' => self.recall::<4>()?,
            b'(' => self.mark()?,
            b')' => self.push_tuple(Vec::new())?,
            0x85..=0x87 => {
                let count = usize::from(code - 0x84);
                let first = self.stack.len().checked_sub(count).ok_or(EMPTY)?;
                let items = self.above(first)?;
                self.push_tuple(items)?;
            }
            b't' => {
                let items = self.marked()?;
                self.push_tuple(items)?;
            }
            b'Q' => self.persistent()?,
            b'R' => self.call()?,
            b's' => {
                let first = self.stack.len().checked_sub(2).ok_or(EMPTY)?;
                let items = self.above(first)?;
                self.set_items(&items)?;
            }
            b'u' => {
                let items = self.marked()?;
                self.set_items(&items)?;
            }
            b'a' => {
                self.pop()?;
                self.list()?;
            }
            b'e' => {
                self.marked()?;
                self.list()?;
            }
            b'b' => self.build()?,
            b'.' => return self.pop().map(Some),
            _ => return Err(format!("instruction {code:#04x} is none that a state dict needs")),
        }
        Ok(None)
    }

    /// The next `length` bytes.
    fn take(&mut self, length: usize) -> Result<&'a [u8], String> {
        let end = self.at.checked_add(length);
        let bytes = end.and_then(|end| self.bytes.get(self.at..end));
        let bytes = bytes.ok_or("cut off: an instruction goes beyond the end")?;
        self.at += length;
        Ok(bytes)
    }

    /// The next `N` bytes.
    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    /// The next bytes up to a line feed.
    fn line(&mut self) -> Result<&'a str, String> {
        let rest = &self.bytes[self.at..];
        let length = rest.iter().position(|&byte| byte == b'\n').ok_or("cut off in a name")?;
        let line = self.take(length + 1)?;
        std::str::from_utf8(&line[..length]).map_err(|_| "a name that is not UTF-8".to_owned())
    }

    /// An unsigned number of `N` bytes, at most 4.
    fn unsigned<const N: usize>(&mut self) -> Result<u32, String> {
        let mut word = [0; 4];
        word[..N].copy_from_slice(self.take(N)?);
        Ok(u32::from_le_bytes(word))
    }

    fn protocol(&mut self) -> Result<(), String> {
        match self.array()? {
            [2] => Ok(()),
            [other] => Err(format!(
                "protocol {other}; torch.save writes 2 unless it is told otherwise: save the \
                 checkpoint again without pickle_protocol"
            )),
        }
    }

    fn push(&mut self, value: Value<'a>) -> Result<(), String> {
        if self.stack.len() == DEEPEST {
            return Err(format!("more than {DEEPEST} values on the stack"));
        }
        self.stack.push(value);
        Ok(())
    }

    fn pop(&mut self) -> Result<Value<'a>, String> {
        let floor = self.marks.last().copied().unwrap_or(0);
        if self.stack.len() <= floor {
            return Err(EMPTY.to_owned());
        }
        self.stack.pop().ok_or_else(|| EMPTY.to_owned())
    }

    /// Removes the values from the height `first` on.
    fn above(&mut self, first: usize) -> Result<Vec<Value<'a>>, String> {
        if self.marks.last().is_some_and(|&mark| mark > first) {
            return Err(EMPTY.to_owned());
        }
        Ok(self.stack.split_off(first))
    }

    fn mark(&mut self) -> Result<(), String> {
        if self.marks.len() == DEEPEST {
            return Err(format!("more than {DEEPEST} marks"));
        }
        self.marks.push(self.stack.len());
        Ok(())
    }

    /// Removes the values above the last mark, and the mark.
    fn marked(&mut self) -> Result<Vec<Value<'a>>, String> {
        let mark = self.marks.pop().ok_or("no mark")?;
        self.above(mark)
    }

    fn push_tuple(&mut self, items: Vec<Value<'a>>) -> Result<(), String> {
        self.pickle.tuples.push(items);
        self.push(Value::Tuple(self.pickle.tuples.len() - 1))
    }

    fn push_dict(&mut self) -> Result<(), String> {
        self.pickle.dicts.push(Vec::new());
        self.push(Value::Dict(self.pickle.dicts.len() - 1))
    }

    fn number<const N: usize>(&mut self) -> Result<(), String> {
        let number = self.unsigned::<N>()?;
        self.push(Value::Int(number.into()))
    }

    /// An integer of any length, least byte first, in two's complement.
    fn long(&mut self) -> Result<(), String> {
        let [length] = self.array()?;
        let bytes = self.take(length.into())?;
        let negative = bytes.last().is_some_and(|&byte| byte >= 0x80);
        let mut word = [if negative { 0xff } else { 0 }; 8];
        let value = match word.get_mut(..bytes.len()) {
            Some(low) => {
                low.copy_from_slice(bytes);
                Value::Int(i64::from_le_bytes(word))
            }
            None => Value::Other,
        };
        self.push(value)
    }

    fn remember<const N: usize>(&mut self) -> Result<(), String> {
        let number = self.unsigned::<N>()?;
        let top = *self.stack.last().ok_or(EMPTY)?;
        self.memo.insert(number, top);
        Ok(())
    }

    fn recall<const N: usize>(&mut self) -> Result<(), String> {
        let number = self.unsigned::<N>()?;
        let value = *self.memo.get(&number).ok_or("a value that was never remembered")?;
        self.push(value)
    }

    /// The number of the tuple on top of the stack, which is removed.
    fn pop_tuple(&mut self) -> Result<usize, String> {
        match self.pop()? {
            Value::Tuple(number) => Ok(number),
            _ => Err("no tuple where one is needed".to_owned()),
        }
    }

    /// A reference to what lies outside of the pickle: a storage.
    fn persistent(&mut self) -> Result<(), String> {
        let number = self.pop_tuple()?;
        let &[Value::Text("storage"), Value::Global(Global::Storage(kind)), Value::Text(key), ..] =
            self.pickle.tuples[number].as_slice()
        else {
            return Err("a reference to something else than a storage".to_owned());
        };
        if key.len() > LONGEST_KEY {
            return Err(format!("a storage with a name of {} bytes", key.len()));
        }
        self.push(Value::Storage(Storage { kind, key }))
    }

    /// What a call of the name below the arguments would give, without a call.
    fn call(&mut self) -> Result<(), String> {
        let arguments = self.pop_tuple()?;
        let Value::Global(function) = self.pop()? else {
            return Err("a call of something that has no name".to_owned());
        };
        match (function, self.pickle.tuples[arguments].as_slice()) {
            (Global::OrderedDict, []) => self.push_dict(),
            (Global::Parameter, &[tensor @ Value::Tensor(_), ..]) => self.push(tensor),
            (
                Global::Tensor,
                &[
                    Value::Storage(storage),
                    Value::Int(offset),
                    Value::Tuple(shape),
                    Value::Tuple(strides),
                    ..,
                ],
            ) => {
                let offset = usize::try_from(offset).map_err(|_| "a tensor with an offset < 0")?;
                let (shape, strides) = (self.lengths(shape)?, self.lengths(strides)?);
                self.pickle.tensors.push(View { storage, offset, shape, strides });
                self.push(Value::Tensor(self.pickle.tensors.len() - 1))
            }
            _ => Err(format!("{function:?} with arguments that are not its own")),
        }
    }

    /// The tuple `number` as lengths.
    fn lengths(&self, number: usize) -> Result<Vec<usize>, String> {
        let items = &self.pickle.tuples[number];
        if items.len() > MOST_DIMENSIONS {
            return Err(format!("a tensor of {} dimensions", items.len()));
        }
        let length = |item: &Value| match item {
            Value::Int(length) => usize::try_from(*length).ok(),
            _ => None,
        };
        let lengths = items.iter().map(length).collect::<Option<_>>();
        lengths.ok_or_else(|| "a shape or stride that is no whole number from 0 on".to_owned())
    }

    /// Puts keys and values, one after the other, into the dictionary on top of the stack.
    fn set_items(&mut self, items: &[Value<'a>]) -> Result<(), String> {
        let (pairs, rest) = items.as_chunks::<2>();
        match self.stack.last() {
            Some(&Value::Dict(number)) if rest.is_empty() => {
                let pairs = pairs.iter().map(|&[key, value]| (key, value));
                self.pickle.dicts[number].extend(pairs);
                Ok(())
            }
            _ => Err("keys and values without a dictionary".to_owned()),
        }
    }

    /// Lists are of no use to a network: their items are gone, the list itself stays.
    fn list(&self) -> Result<(), String> {
        match self.stack.last() {
            Some(Value::Other) => Ok(()),
            _ => Err("items without a list".to_owned()),
        }
    }

    /// Attributes of an object. Those of a state dict hold versions of modules and no weights.
    fn build(&mut self) -> Result<(), String> {
        self.pop()?;
        match self.stack.last() {
            Some(Value::Dict(_)) => Ok(()),
            _ => Err("attributes of something else than a dictionary".to_owned()),
        }
    }
}
