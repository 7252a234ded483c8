//! Kinds of numbers in files of other programs, and what becomes of those that are not f32.

use half::{bf16, f16};

/// What is done with numbers that are floats of another width than f32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cast {
    /// They are refused.
    #[default]
    Refused,
    /// They are rounded to the nearest f32, or widened.
    ToF32,
}

/// The f32 that the first bytes stand for.
pub(super) type Number = fn(&[u8]) -> f32;

/// How floats of a kind are read.
pub(super) struct FloatReader {
    /// Bytes of one.
    pub(super) size: usize,
    /// It as an f32.
    pub(super) number: Number,
}

/// A kind of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    F32,
    F64,
    F16,
    Bf16,
    /// Integers, truth values, and what is not known.
    NoFloat,
}

impl Kind {
    /// The kind of the numbers of the storage `name` of PyTorch.
    pub(super) fn of_storage(name: &str) -> Option<Self> {
        Some(match name {
            "FloatStorage" => Self::F32,
            "DoubleStorage" => Self::F64,
            "HalfStorage" => Self::F16,
            "BFloat16Storage" => Self::Bf16,
            "LongStorage" | "IntStorage" | "ShortStorage" | "CharStorage" | "ByteStorage"
            | "BoolStorage" => Self::NoFloat,
            _ => return None,
        })
    }

    /// The kind with the number `data_type` in ONNX.
    pub(super) fn of_onnx(data_type: i32) -> Self {
        match data_type {
            1 => Self::F32,
            11 => Self::F64,
            10 => Self::F16,
            16 => Self::Bf16,
            _ => Self::NoFloat,
        }
    }

    /// How floats of the kind are read.
    ///
    /// # Errors
    /// A sentence with the remedy, for numbers that are no f32 if `cast` does not allow them.
    pub(super) fn reader(self, cast: Cast) -> Result<FloatReader, String> {
        let (name, size, number): (&str, usize, Number) = match self {
            Self::F32 => ("float32", 4, |bytes| f32::from_le_bytes(array(bytes))),
            Self::F64 => ("float64", 8, |bytes| f64::from_le_bytes(array(bytes)) as f32),
            Self::F16 => ("float16", 2, |bytes| f16::from_le_bytes(array(bytes)).to_f32()),
            Self::Bf16 => ("bfloat16", 2, |bytes| bf16::from_le_bytes(array(bytes)).to_f32()),
            Self::NoFloat => return Err("its numbers are no floats".to_owned()),
        };
        if self != Self::F32 && cast == Cast::Refused {
            return Err(format!(
                "its numbers are {name}, a policy's float32; --cast converts them"
            ));
        }
        Ok(FloatReader { size, number })
    }
}

/// The first `N` bytes.
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(&bytes[..N]);
    array
}
