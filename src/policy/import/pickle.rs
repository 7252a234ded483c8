//! The part of Python's pickle format that describes tensors; nothing in a file is ever executed.
//!
//! A pickle is a program for a stack machine that names Python functions and calls them. This one calls
//! none: it knows what a few of them would give (`calls.rs`), keeps every other call as an object that
//! nobody made, and refuses names that no policy has a use for.

use std::collections::HashMap;

use super::calls;
use super::kind::{self, Kind};
use super::value::{Name, Pickle, Place, Storage, Value};

/// Most instructions: some 100,000 tensors.
const LONGEST: usize = 1 << 22;
/// Most values on the stack; Python's own writer puts 2,000 there at most.
const DEEPEST: usize = 1 << 16;
/// Longest name of a storage, bytes; PyTorch numbers them.
const LONGEST_KEY: usize = 32;
/// The newest protocol.
const NEWEST: u8 = 5;
/// What is wrong with a module that PyTorch before 1.6 saved with its code.
const WHOLE_MODULE: &str = "a whole module, which a program would have to make; nothing was executed. Save tensors alone: \
                            torch.save(module.state_dict(), FILE)";
/// What is wrong where an instruction finds too little on the stack.
const EMPTY: &str = "a value is needed where there is none";

/// A pickle that was read.
#[derive(Debug)]
pub(super) struct Unpickled<'a> {
    /// Its containers.
    pub(super) pickle: Pickle<'a>,
    /// The value that it stands for.
    pub(super) root: Value<'a>,
    /// Bytes that it takes; more may follow.
    pub(super) length: usize,
}

/// Reads the pickle that `bytes` begin with.
///
/// # Errors
/// A sentence with the byte at which the pickle is damaged, or asks for what is not allowed.
pub(super) fn read(bytes: &[u8]) -> Result<Unpickled<'_>, String> {
    let mut machine = Machine { bytes, ..Machine::default() };
    for _ in 0..LONGEST {
        let at = machine.at;
        match machine.step() {
            Ok(None) => {}
            Ok(Some(root)) => {
                return Ok(Unpickled { pickle: machine.pickle, root, length: machine.at });
            }
            Err(problem) => return Err(format!("pickle, byte {at}: {problem}")),
        }
    }
    Err(format!("a pickle of more than {LONGEST} instructions; no policy needs as many"))
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
            // A frame says how many bytes are to be read at once.
            0x95 => _ = self.take(8)?,
            b'N' => self.push(Value::Other)?,
            b'G' => {
                self.take(8)?;
                self.push(Value::Float)?;
            }
            0x88 | 0x89 => self.push(Value::Truth(code == 0x88))?,
            b'K' | b'M' | b'J' | 0x8a => self.number(code)?,
            b'X' | 0x8c | 0x8d | b'U' | b'T' => self.text(code)?,
            b'B' | b'C' | 0x8e | 0x96 => self.run_of_bytes(code)?,
            b'c' | 0x93 => self.name(code)?,
            b'q' | b'r' | 0x94 => self.remember(code)?,
            b'h' => self.recall::<1>()?,
            b'j' => self.recall::<4>()?,
            b'0' => _ = self.pop()?,
            b'1' => _ = self.marked()?,
            b'2' => {
                let top = *self.stack.last().ok_or(EMPTY)?;
                self.push(top)?;
            }
            b'(' => self.mark()?,
            b'}' | b']' | 0x8f | b')' | 0x85..=0x87 | b't' | 0x91 => self.container(code)?,
            b'Q' => self.persistent()?,
            b'R' | 0x81 | 0x92 => self.call(code)?,
            b's' | b'u' | b'a' | b'e' | 0x90 => self.fill(code)?,
            b'b' => self.build()?,
            b'.' => return self.pop().map(Some),
            _ => return Err(format!("instruction {code:#04x} is none that a policy needs")),
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

    /// What follows its length, of 1, 4 or 8 bytes.
    fn counted(&mut self, size: usize) -> Result<&'a [u8], String> {
        let mut word = [0; 8];
        word[..size].copy_from_slice(self.take(size)?);
        let length = usize::try_from(u64::from_le_bytes(word));
        self.take(length.unwrap_or(usize::MAX))
    }

    fn protocol(&mut self) -> Result<(), String> {
        match self.array()? {
            [2..=NEWEST] => Ok(()),
            [other] => Err(format!(
                "protocol {other}; from 2 to {NEWEST} are read: save the file again without \
                 pickle_protocol"
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

    /// Removes the topmost `count` values.
    fn topmost(&mut self, count: usize) -> Result<Vec<Value<'a>>, String> {
        let first = self.stack.len().checked_sub(count).ok_or(EMPTY)?;
        self.above(first)
    }

    /// An integer of 1, 2 or 4 bytes, or of any length in two's complement.
    fn number(&mut self, code: u8) -> Result<(), String> {
        let value = match code {
            b'K' => Value::Int(self.unsigned::<1>()?.into()),
            b'M' => Value::Int(self.unsigned::<2>()?.into()),
            b'J' => Value::Int(i32::from_le_bytes(self.array()?).into()),
            _ => Value::long(self.counted(1)?),
        };
        self.push(value)
    }

    /// A text, or what Python 2 called one.
    fn text(&mut self, code: u8) -> Result<(), String> {
        let size = match code {
            0x8c | b'U' => 1,
            0x8d => 8,
            _ => 4,
        };
        let bytes = self.counted(size)?;
        let value = match std::str::from_utf8(bytes) {
            Ok(text) => Value::Text(text),
            Err(_) if matches!(code, b'U' | b'T') => calls::bytes(&mut self.pickle, bytes.to_vec()),
            Err(_) => return Err("a text that is not UTF-8".to_owned()),
        };
        self.push(value)
    }

    fn run_of_bytes(&mut self, code: u8) -> Result<(), String> {
        let size = match code {
            b'C' => 1,
            b'B' => 4,
            _ => 8,
        };
        let bytes = self.counted(size)?.to_vec();
        let value = calls::bytes(&mut self.pickle, bytes);
        self.push(value)
    }

    /// A name: two lines, or two texts on the stack.
    fn name(&mut self, code: u8) -> Result<(), String> {
        let (module, name) = match code {
            b'c' => (self.line()?, self.line()?),
            _ => match self.topmost(2)?.as_slice() {
                &[Value::Text(module), Value::Text(name)] => (module, name),
                _ => return Err("a name that is no text".to_owned()),
            },
        };
        let name = Name { module, name };
        calls::is_harmless(name)?;
        self.push(Value::Name(name))
    }

    fn remember(&mut self, code: u8) -> Result<(), String> {
        let number = match code {
            b'q' => self.unsigned::<1>()?,
            b'r' => self.unsigned::<4>()?,
            _ => self.memo.len() as u32,
        };
        let top = *self.stack.last().ok_or(EMPTY)?;
        self.memo.insert(number, top);
        Ok(())
    }

    fn recall<const N: usize>(&mut self) -> Result<(), String> {
        let number = self.unsigned::<N>()?;
        let value = *self.memo.get(&number).ok_or("a value that was never remembered")?;
        self.push(self.pickle.recalled(value))
    }

    /// A dictionary, a list, a set or a tuple.
    fn container(&mut self, code: u8) -> Result<(), String> {
        let pickle = &mut self.pickle;
        let value = match code {
            b'}' => calls::dict(pickle),
            b']' | 0x8f => calls::list(pickle, Vec::new()),
            0x91 => {
                let items = self.marked()?;
                calls::list(&mut self.pickle, items)
            }
            _ => {
                let items = match code {
                    b')' => Vec::new(),
                    b't' => self.marked()?,
                    _ => self.topmost(usize::from(code - 0x84))?,
                };
                self.pickle.tuples.push(items);
                Value::Tuple(self.pickle.tuples.len() - 1)
            }
        };
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
        let tuple = self.pop_tuple()?;
        let (kind, key) = match calls::head(&self.pickle, tuple).as_slice() {
            [Value::Text("storage"), Value::Name(kind), Value::Text(key), ..] => (*kind, *key),
            [Value::Text("module"), ..] => return Err(WHOLE_MODULE.to_owned()),
            _ => return Err("a reference to something else than a storage".to_owned()),
        };
        let known = Kind::of_storage(kind.name).filter(|_| kind.module == "torch");
        let kind = known.ok_or_else(|| kind::unread(&kind))?;
        if key.len() > LONGEST_KEY {
            return Err(format!("a storage with a name of {} bytes", key.len()));
        }
        self.pickle.storages.insert(key, kind);
        self.push(Value::Storage(Storage { kind, place: Place::Entry(key) }))
    }

    /// What a call of the name below the arguments would give, without a call.
    fn call(&mut self, code: u8) -> Result<(), String> {
        let named = if code == 0x92 { self.pop()? } else { Value::Other };
        let arguments = self.pop_tuple()?;
        let value = match self.pop()? {
            Value::Name(function) => calls::result(&mut self.pickle, function, arguments)?,
            // A bound method, or what else an object of an unknown class gives.
            unknown @ Value::Object(number) => {
                self.pickle.objects[number].parts.push(Value::Tuple(arguments));
                unknown
            }
            _ => return Err("a call of something that has no name".to_owned()),
        };
        self.pickle.add_named(value, named)?;
        self.push(value)
    }

    /// Puts items into the container below them.
    fn fill(&mut self, code: u8) -> Result<(), String> {
        let items = match code {
            b's' => self.topmost(2)?,
            b'a' => self.topmost(1)?,
            _ => self.marked()?,
        };
        let into = *self.stack.last().ok_or(EMPTY)?;
        let pairs = matches!(code, b's' | b'u');
        match into {
            Value::Dict(number) if pairs => self.set_items(number, &items),
            Value::List(number) if !pairs => {
                self.pickle.lists[number].extend(items);
                Ok(())
            }
            // A dictionary or a list of a class of its own.
            Value::Object(number) => {
                let part = if pairs { calls::dict(&mut self.pickle) } else { Value::Other };
                self.pickle.objects[number].parts.push(part);
                if let Value::Dict(dict) = part { self.set_items(dict, &items) } else { Ok(()) }
            }
            _ if pairs => Err("keys and values without a dictionary".to_owned()),
            _ => Err("items without a list".to_owned()),
        }
    }

    /// Puts keys and values, one after the other, into a dictionary.
    fn set_items(&mut self, dict: usize, items: &[Value<'a>]) -> Result<(), String> {
        let (pairs, rest) = items.as_chunks::<2>();
        if !rest.is_empty() {
            return Err("a key without a value".to_owned());
        }
        self.pickle.dicts[dict].extend(pairs.iter().map(|&[key, value]| (key, value)));
        Ok(())
    }

    /// Attributes of an object. Those of a state dict hold versions of modules and no weights.
    fn build(&mut self) -> Result<(), String> {
        let state = self.pop()?;
        let top = self.stack.last_mut().ok_or(EMPTY)?;
        match *top {
            Value::Dict(_) | Value::Tensor(_) | Value::List(_) => {
                self.pickle.refuse_attributes(state)
            }
            Value::Type(kind) => calls::order(&mut self.pickle, kind, state),
            Value::Object(number) => {
                match calls::filled(&mut self.pickle, number, state)? {
                    Some(array) => *top = array,
                    None => self.pickle.objects[number].parts.push(state),
                }
                Ok(())
            }
            _ => Err("attributes of something that has none".to_owned()),
        }
    }
}
