//! Opening a backend without a choice to make.

use super::{Backend, cpu, gpu};
use crate::error::Result;

impl Backend {
    /// The processor, with as many threads as it runs at once; [`cpu::Cpu::new`] takes another number.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the system refuses the threads.
    pub fn cpu() -> Result<Self> {
        cpu::Cpu::new(None).map(Self::Cpu)
    }

    /// An adapter, hardware before software; `gpu::Gpu::open` takes a choice.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if there is none or it does not open, and always where the crate is
    /// built without its feature `gpu`.
    pub fn gpu() -> Result<Self> {
        gpu::any().map(Self::Gpu)
    }

    /// The hardware adapter of this machine, or the CPU where there is none. A software adapter is
    /// slower than the CPU and is not taken; a build without the feature `gpu` takes the CPU.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the adapter does not open, or the system refuses threads.
    pub fn auto() -> Result<Self> {
        gpu::hardware()?.map_or_else(Self::cpu, |gpu| Ok(Self::Gpu(gpu)))
    }
}

#[cfg(all(test, not(feature = "gpu")))]
mod tests {
    use super::*;

    #[test]
    fn a_build_without_adapters_says_so_and_takes_the_cpu() {
        assert_eq!(Backend::auto().unwrap().name(), "cpu");
        let refused = Backend::gpu().unwrap_err().to_string();
        assert!(refused.contains("feature `gpu`"), "{refused}");
    }
}
