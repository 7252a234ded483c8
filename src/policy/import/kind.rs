//! Kinds of numbers in files of other programs, and what becomes of those that are not f32.

use half::{bf16, f16};
use safetensors::Dtype;

/// What is done with numbers that are floats of another width than f32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cast {
    /// They are refused.
    #[default]
    Refused,
    /// They are rounded to the nearest f32, or widened.
    ToF32,
}

/// The number that the first bytes stand for, exactly.
pub(super) type Number = fn(&[u8]) -> f64;

/// How floats of a kind are read.
pub(super) struct FloatReader {
    /// Bytes of one.
    pub(super) size: usize,
    /// One as a number.
    pub(super) number: Number,
}

/// A kind of number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    F32,
    F64,
    F16,
    Bf16,
    /// Floats whose first byte is the most significant one.
    Swapped,
    /// Integers, truth values, and what is not known; bytes of one, where that is known.
    NoFloat(u8),
}

/// The refusal of a storage of PyTorch whose numbers are not read.
pub(super) fn unread(name: &impl std::fmt::Display) -> String {
    format!(
        "`{name}` is no storage of PyTorch that is read: quantised, complex and 8-bit numbers are not; save the tensors as \
         x.float(), of the network before it was quantised"
    )
}

impl Kind {
    /// The kind of the numbers of the storage `name` of PyTorch.
    pub(super) fn of_storage(name: &str) -> Option<Self> {
        Some(match name {
            "FloatStorage" => Self::F32,
            "DoubleStorage" => Self::F64,
            "HalfStorage" => Self::F16,
            "BFloat16Storage" => Self::Bf16,
            "LongStorage" => Self::NoFloat(8),
            "IntStorage" => Self::NoFloat(4),
            "ShortStorage" => Self::NoFloat(2),
            "CharStorage" | "ByteStorage" | "BoolStorage" => Self::NoFloat(1),
            _ => return None,
        })
    }

    /// The kind that NumPy calls `name`, as in `f4`.
    pub(super) fn of_numpy(name: &str) -> Self {
        match name {
            "f4" | "<f4" | "float32" => Self::F32,
            "f8" | "<f8" | "float64" => Self::F64,
            "f2" | "<f2" | "float16" => Self::F16,
            "bfloat16" => Self::Bf16,
            _ if name.starts_with(">f") => Self::Swapped,
            _ => Self::NoFloat(0),
        }
    }

    /// The kind of the numbers of a safetensors file.
    pub(super) fn of_safetensors(kind: Dtype) -> Self {
        match kind {
            Dtype::F32 => Self::F32,
            Dtype::F64 => Self::F64,
            Dtype::F16 => Self::F16,
            Dtype::BF16 => Self::Bf16,
            _ => Self::NoFloat(0),
        }
    }

    /// The kind with the most significant byte first.
    pub(super) fn swapped(self) -> Self {
        if self.is_float() { Self::Swapped } else { self }
    }

    /// The kind with the number `data_type` in ONNX.
    pub(super) fn of_onnx(data_type: i32) -> Self {
        match data_type {
            1 => Self::F32,
            11 => Self::F64,
            10 => Self::F16,
            16 => Self::Bf16,
            _ => Self::NoFloat(0),
        }
    }

    /// Whether numbers of the kind are floats.
    pub(super) fn is_float(self) -> bool {
        !matches!(self, Self::NoFloat(_))
    }

    /// Bytes of a number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::F16 | Self::Bf16 => 2,
            Self::F32 | Self::Swapped => 4,
            Self::F64 => 8,
            Self::NoFloat(size) => size.into(),
        }
    }

    /// How floats of the kind are read.
    ///
    /// # Errors
    /// A sentence with the remedy, for numbers that are no f32 if `cast` does not allow them.
    pub(super) fn reader(self, cast: Cast) -> Result<FloatReader, String> {
        let (name, size, number): (&str, usize, Number) = match self {
            Self::F32 => ("float32", 4, |bytes| f32::from_le_bytes(array(bytes)).into()),
            Self::F64 => ("float64", 8, |bytes| f64::from_le_bytes(array(bytes))),
            Self::F16 => ("float16", 2, |bytes| f16::from_le_bytes(array(bytes)).to_f64()),
            Self::Bf16 => ("bfloat16", 2, |bytes| bf16::from_le_bytes(array(bytes)).to_f64()),
            Self::Swapped => {
                return Err("its numbers have the most significant byte first; in NumPy: \
                            x.astype('<f4')"
                    .to_owned());
            }
            Self::NoFloat(_) => {
                return Err("its numbers are no floats of 16, 32 or 64 bits; save x.float(), and a quantised \
                            network as it was before: integers say nothing of their scale"
                    .to_owned());
            }
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
