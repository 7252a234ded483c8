//! What the calls of a pickle would give, told by their names and arguments; none is made.

use super::kind::Kind;
use super::value::{Name, Object, Pickle, Place, Storage, Value, View};

/// Most dimensions of a tensor, PyTorch's limit.
const MOST_DIMENSIONS: usize = 64;
/// Arguments of a call that are looked at.
const ARGUMENTS: usize = 8;
/// Modules that read, write, run or load: a file that names one of them is no policy.
const HOSTILE: [&str; 35] = [
    "os",
    "posix",
    "nt",
    "sys",
    "subprocess",
    "shutil",
    "socket",
    "runpy",
    "pty",
    "importlib",
    "ctypes",
    "webbrowser",
    "pickle",
    "_pickle",
    "marshal",
    "code",
    "codeop",
    "commands",
    "pip",
    "pdb",
    "timeit",
    "multiprocessing",
    "platform",
    "tempfile",
    "urllib",
    "requests",
    "io",
    "_io",
    "glob",
    "operator",
    "_operator",
    "dill",
    "asyncio",
    "bdb",
    "http",
];
/// Functions of other modules that do so.
const LOADERS: [&str; 16] = [
    "load",
    "loads",
    "loadtxt",
    "load_module",
    "fromfile",
    "memmap",
    "genfromtxt",
    "save",
    "savez",
    "savetxt",
    "dump",
    "dumps",
    "open",
    "open_memmap",
    "compile_file",
    "load_state_dict_from_url",
];
/// Names of Python itself that make plain values.
const BUILTINS: [&str; 14] = [
    "object",
    "set",
    "frozenset",
    "slice",
    "complex",
    "bytearray",
    "list",
    "dict",
    "tuple",
    "int",
    "float",
    "bool",
    "str",
    "range",
];

/// Refuses a name that only a program has a use for.
///
/// # Errors
/// The refusal.
pub(super) fn is_harmless(Name { module, name }: Name<'_>) -> Result<(), String> {
    let first = module.split('.').next().unwrap_or_default();
    let builtin = matches!(first, "builtins" | "__builtin__") && !BUILTINS.contains(&name);
    let loader = LOADERS.contains(&name);
    if builtin && name == "getattr" {
        return Err(format!(
            "names `{module}.{name}`, with which objects of Python are made, as policy.save() of stable-baselines3 and \
             torch.save(module, FILE) write them; nothing was executed. Save the model, model.save(FILE), or tensors alone: \
             torch.save(model.policy.state_dict(), FILE)"
        ));
    }
    match builtin || loader || HOSTILE.contains(&first) {
        true => Err(format!(
            "names `{module}.{name}`, which runs programs, or reads or writes files; nothing was executed, and the file is not to be trusted"
        )),
        false => Ok(()),
    }
}

/// A new dictionary.
pub(super) fn dict<'a>(pickle: &mut Pickle<'a>) -> Value<'a> {
    pickle.dicts.push(Vec::new());
    Value::Dict(pickle.dicts.len() - 1)
}

/// A new list.
pub(super) fn list<'a>(pickle: &mut Pickle<'a>, items: Vec<Value<'a>>) -> Value<'a> {
    pickle.lists.push(items);
    Value::List(pickle.lists.len() - 1)
}

/// A new run of bytes.
pub(super) fn bytes<'a>(pickle: &mut Pickle<'a>, bytes: Vec<u8>) -> Value<'a> {
    pickle.bytes.push(bytes);
    Value::Bytes(pickle.bytes.len() - 1)
}

/// What `function` would give for the arguments in the tuple number `tuple`.
///
/// # Errors
/// A sentence about a known function with arguments that are not its own.
pub(super) fn result<'a>(
    pickle: &mut Pickle<'a>,
    function: Name<'a>,
    tuple: usize,
) -> Result<Value<'a>, String> {
    let arguments = head(pickle, tuple);
    let other = || Err(format!("{function} with arguments that are not its own"));
    let numpy = function.module.starts_with("numpy.");
    match (function.module, function.name, arguments.as_slice()) {
        ("collections", "OrderedDict", []) | ("collections", "defaultdict", [] | [_]) => {
            Ok(dict(pickle))
        }
        ("collections", "OrderedDict" | "defaultdict", _) => other(),
        ("flax.core.frozen_dict", "FrozenDict", &[dict @ Value::Dict(_)]) => Ok(dict),
        ("torch._utils", "_rebuild_tensor_v2", rest) => {
            tensor(pickle, rest)?.map_or_else(other, Ok)
        }
        (
            "torch._utils",
            "_rebuild_parameter" | "_rebuild_parameter_with_state",
            &[tensor @ Value::Tensor(_), _, _, ref state @ ..],
        ) => state.iter().try_for_each(|&s| pickle.refuse_attributes(s)).map(|()| tensor),
        (
            "torch._tensor",
            "_rebuild_from_type_v2",
            &[Value::Name(inner), _, Value::Tuple(inside), ref state @ ..],
        ) if inner != function => {
            state.iter().try_for_each(|&state| pickle.refuse_attributes(state))?;
            result(pickle, inner, inside)
        }
        ("_codecs", "encode", &[Value::Text(text), Value::Text("latin1" | "latin-1")]) => {
            latin(pickle, text)
        }
        ("numpy", "dtype", &[Value::Text(name), ..] | &[Value::Name(Name { name, .. }), ..]) => {
            pickle.kinds.push(Kind::of_numpy(name));
            Ok(Value::Type(pickle.kinds.len() - 1))
        }
        (_, "scalar", &[Value::Type(kind), Value::Bytes(number)]) if numpy => {
            Ok(array(pickle, kind, number, Vec::new(), false))
        }
        (
            _,
            "_frombuffer",
            &[Value::Bytes(number), Value::Type(kind), Value::Tuple(shape), Value::Text(order)],
        ) if numpy => {
            let shape = lengths(pickle, shape)?;
            Ok(array(pickle, kind, number, shape, order == "F"))
        }
        (
            _,
            "_reconstruct_array" | "reconstruct_device_array",
            &[Value::Name(maker), _, state, ..],
        ) if function.module.starts_with("jax") => {
            let made = object(pickle, maker, Vec::new());
            filled(pickle, made, state)?.map_or_else(other, Ok)
        }
        ("copyreg" | "copy_reg", "_reconstructor", &[Value::Name(class), ..]) => {
            Ok(Value::Object(object(pickle, class, Vec::new())))
        }
        _ => Ok(Value::Object(object(pickle, function, vec![Value::Tuple(tuple)]))),
    }
}

/// The array that the object number `number` is, if it is one and `state` are its numbers.
///
/// # Errors
/// A sentence about a shape that is none.
pub(super) fn filled<'a>(
    pickle: &mut Pickle<'a>,
    number: usize,
    state: Value<'a>,
) -> Result<Option<Value<'a>>, String> {
    let Name { module, name } = pickle.objects[number].maker;
    let (true, Value::Tuple(state)) =
        (module.starts_with("numpy") && name == "_reconstruct", state)
    else {
        return Ok(None);
    };
    let state = head(pickle, state);
    // The first is a version.
    let state = if let [Value::Int(_), rest @ ..] = state.as_slice() { rest } else { &state };
    match *state {
        [Value::Tuple(shape), Value::Type(kind), Value::Truth(by_columns), Value::Bytes(bytes)] => {
            let shape = lengths(pickle, shape)?;
            let array = array(pickle, kind, bytes, shape, by_columns);
            pickle.objects[number].array = Some(array);
            Ok(Some(array))
        }
        _ => Ok(None),
    }
}

/// Turns a kind of numbers around, wherever it is used from now on, if `state` says so.
///
/// # Errors
/// A sentence about a state that is none.
pub(super) fn order<'a>(
    pickle: &mut Pickle<'a>,
    kind: usize,
    state: Value<'a>,
) -> Result<(), String> {
    let items = if let Value::Tuple(number) = state { head(pickle, number) } else { Vec::new() };
    match items.as_slice() {
        [_, Value::Text(">"), ..] => pickle.kinds[kind] = pickle.kinds[kind].swapped(),
        [_, Value::Text(_), ..] => {}
        _ => return Err("a kind of numbers without an order of bytes".to_owned()),
    }
    Ok(())
}

/// The first items of a tuple.
pub(super) fn head<'a>(pickle: &Pickle<'a>, tuple: usize) -> Vec<Value<'a>> {
    pickle.tuples[tuple].iter().take(ARGUMENTS).copied().collect()
}

/// An object that nobody made.
fn object<'a>(pickle: &mut Pickle<'a>, maker: Name<'a>, parts: Vec<Value<'a>>) -> usize {
    pickle.objects.push(Object { maker, parts, array: None });
    pickle.objects.len() - 1
}

/// The bytes that a text of protocol 2 stands for, once for each text.
fn latin<'a>(pickle: &mut Pickle<'a>, text: &'a str) -> Result<Value<'a>, String> {
    let place = text.as_ptr().addr();
    if let Some(&number) = pickle.encoded.get(&place) {
        return Ok(Value::Bytes(number));
    }
    let byte = |c: char| u8::try_from(u32::from(c));
    let encoded: Result<Vec<u8>, _> = text.chars().map(byte).collect();
    let value = bytes(pickle, encoded.map_err(|_| "bytes that are not written as Latin-1")?);
    pickle.encoded.insert(place, pickle.bytes.len() - 1);
    Ok(value)
}

/// An array of NumPy whose numbers are a run of bytes.
fn array<'a>(
    pickle: &mut Pickle<'a>,
    kind: usize,
    bytes: usize,
    shape: Vec<usize>,
    by_columns: bool,
) -> Value<'a> {
    let mut step = 1_usize;
    let mut strides: Vec<usize> = vec![0; shape.len()];
    let mut pass = |i: usize| {
        strides[i] = step;
        step = step.saturating_mul(shape[i]);
    };
    match by_columns {
        true => (0..shape.len()).for_each(&mut pass),
        false => (0..shape.len()).rev().for_each(&mut pass),
    }
    let storage = Storage { kind: pickle.kinds[kind], place: Place::Bytes(bytes) };
    pickle.tensors.push(View { storage, offset: 0, shape, strides });
    Value::Tensor(pickle.tensors.len() - 1)
}

/// A tensor of PyTorch, if the arguments are those of one.
fn tensor<'a>(
    pickle: &mut Pickle<'a>,
    arguments: &[Value<'a>],
) -> Result<Option<Value<'a>>, String> {
    let &[
        Value::Storage(storage),
        Value::Int(offset),
        Value::Tuple(shape),
        Value::Tuple(strides),
        ref rest @ ..,
    ] = arguments
    else {
        return Ok(None);
    };
    refuse_lazy(pickle, rest.get(2))?;
    let offset = usize::try_from(offset).map_err(|_| "a tensor with an offset < 0")?;
    let (shape, strides) = (lengths(pickle, shape)?, lengths(pickle, strides)?);
    pickle.tensors.push(View { storage, offset, shape, strides });
    Ok(Some(Value::Tensor(pickle.tensors.len() - 1)))
}

/// Refuses a tensor whose numbers are not those of its storage, as its last argument says.
fn refuse_lazy(pickle: &Pickle<'_>, marks: Option<&Value<'_>>) -> Result<(), String> {
    let Some(&Value::Dict(marks)) = marks else { return Ok(()) };
    match pickle.dicts[marks].iter().find(|(_, value)| *value == Value::Truth(true)) {
        Some((Value::Text(mark), _)) => Err(format!(
            "a tensor that is marked `{mark}`: its numbers are those of its storage with another sign; save \
             x.resolve_neg().resolve_conj() in its place"
        )),
        _ => Ok(()),
    }
}

/// The tuple number `tuple` as lengths.
fn lengths(pickle: &Pickle<'_>, tuple: usize) -> Result<Vec<usize>, String> {
    let items = &pickle.tuples[tuple];
    if items.len() > MOST_DIMENSIONS {
        return Err(format!("a tensor of {} dimensions", items.len()));
    }
    let length = |item: &Value<'_>| match item {
        Value::Int(length) => usize::try_from(*length).ok(),
        _ => None,
    };
    let lengths = items.iter().map(length).collect::<Option<_>>();
    lengths.ok_or_else(|| "a shape or stride that is no whole number from 0 on".to_owned())
}
