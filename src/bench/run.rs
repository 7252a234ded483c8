//! A benchmark from its start to its record: limits before and after, workloads on each backend,
//! scaling.

use super::limits::{AdapterLimits, HostLimits};
use super::measure::{Protocol, measure, quantile};
use super::record::{
    BENCH_SCHEMA, BackendRecord, BenchRecord, KernelRecord, LeftOutRecord, MachineRecord,
    WorkloadRecord,
};
use super::scaling::{SIZES, scaling};
use super::workload::{Batch, PreparedWorkload, Work, Workload};
use crate::backend::Backend;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::{AdapterKind, KernelTime};
use crate::error::{Error, Result};
use crate::scenario::Watch;

/// Name of the batches of growing size, beside those of the workloads.
const SCALING: &str = "scaling";
/// Most operations of a call on a software adapter: about a second.
const SOFTWARE_FLOPS: f64 = 10e9;
/// Most operations of a call in a quick benchmark.
const QUICK_FLOPS: f64 = 150e9;
/// Calls of which the times of kernels are medians.
const KERNEL_CALLS: usize = 5;
/// How many of the growing batches a quick benchmark runs.
const QUICK_SIZES: usize = 2;

/// What is to be measured.
#[derive(Clone, Debug)]
pub struct Asked {
    /// Few calls, and no large work unless a filter names it.
    pub quick: bool,
    /// Part of the names of what is to run; none for everything.
    pub filter: Option<String>,
    /// Seed of networks, starts and noise.
    pub seed: u64,
    /// Threads of the limits; by default as many as the processor runs at once.
    pub threads: Option<usize>,
}

impl Asked {
    fn protocol(&self) -> Protocol {
        if self.quick { Protocol::QUICK } else { Protocol::FULL }
    }

    fn names(&self, name: &str) -> bool {
        self.filter.as_ref().is_none_or(|filter| name.contains(filter))
    }

    /// The workloads asked for.
    fn chosen(&self, all: Vec<Workload>) -> Result<Vec<Workload>> {
        let known: Vec<String> = all.iter().map(|workload| workload.name.clone()).collect();
        let chosen: Vec<_> = all.into_iter().filter(|one| self.names(&one.name)).collect();
        if chosen.is_empty() && !self.names(SCALING) {
            let known = known.join(", ");
            let problem = format!("part of no workload's name; there are: {known}, {SCALING}");
            let filter = self.filter.as_deref().unwrap_or_default();
            return Err(Error::invalid(format!("--workload {filter}"), problem));
        }
        Ok(chosen)
    }

    /// Why `workload` is left out on `backend`, if it is.
    fn leaves_out(&self, workload: &Workload, backend: &Backend) -> Option<String> {
        let operations = workload.call_flops() / 1e9;
        if is_software(backend) && workload.call_flops() > SOFTWARE_FLOPS {
            return Some(format!(
                "{operations:.0} GFLOP a call; software adapters get at most {:.0}",
                SOFTWARE_FLOPS / 1e9
            ));
        }
        (self.quick && self.filter.is_none() && workload.call_flops() > QUICK_FLOPS).then(|| {
            format!("{operations:.0} GFLOP a call; leave --quick out, or name it with --workload")
        })
    }
}

/// Measures the machine, then what was asked for of `work` on each of `backends`; `note` is given the
/// record whenever something is done, so that an interruption loses no more than it must.
///
/// # Errors
/// [`Error::Invalid`] for a filter that fits nothing; those of the backends; interruption.
pub fn run(
    asked: &Asked,
    work: Work,
    backends: &[Backend],
    watch: &dyn Watch,
    note: &mut dyn FnMut(&BenchRecord) -> Result<()>,
) -> Result<BenchRecord> {
    let Work { workloads, batch } = work;
    let workloads = asked.chosen(workloads)?;
    let (protocol, host) = (asked.protocol(), Cpu::new(asked.threads)?);
    watch.begin("limits", 1);
    let limits = HostLimits::measure(&protocol, host.threads())?;
    watch.advance(1)?;
    let mut record = BenchRecord {
        schema: BENCH_SCHEMA,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        seed: asked.seed,
        machine: machine(&host),
        protocol,
        limits,
        backends: Vec::new(),
        workloads: Vec::new(),
        left_out: Vec::new(),
        scaling: Vec::new(),
        to_come: to_come(asked, &workloads, backends),
    };
    for backend in backends {
        record.add_backend(backend)?;
        for workload in &workloads {
            match asked.leaves_out(workload, backend) {
                Some(reason) => record.leave_out(&workload.name, backend, reason),
                None => {
                    record.add_workload(workload, backend, watch)?;
                    record.is_done(note)?;
                }
            }
        }
        if asked.names(SCALING) {
            record.add_scaling(asked, backend, &batch, watch)?;
            record.is_done(note)?;
        }
    }
    watch.begin("limits", 1);
    let again = HostLimits::measure(&protocol, host.threads())?;
    watch.advance(1)?;
    record.limits = record.limits.better(&again);
    record.hold_against_limits();
    Ok(record)
}

/// What is to be done, in its order.
fn to_come(asked: &Asked, workloads: &[Workload], backends: &[Backend]) -> Vec<String> {
    let of = |backend: &Backend| {
        let kept = workloads.iter().filter(|one| asked.leaves_out(one, backend).is_none());
        let names =
            kept.map(|one| one.name.as_str()).chain(asked.names(SCALING).then_some(SCALING));
        names.map(|name| format!("{name} on {}", backend.name())).collect::<Vec<_>>()
    };
    backends.iter().flat_map(of).collect()
}

impl BenchRecord {
    /// What comes first is done, and the record as it is handed to `note`.
    fn is_done(&mut self, note: &mut dyn FnMut(&Self) -> Result<()>) -> Result<()> {
        self.to_come.remove(0);
        self.hold_against_limits();
        note(self)
    }

    /// Measures and notes a backend.
    fn add_backend(&mut self, backend: &Backend) -> Result<()> {
        let adapter = AdapterLimits::measure(&self.protocol, backend)?;
        self.backends.push(BackendRecord {
            backend: backend.name().to_owned(),
            device: backend.device(),
            adapter,
        });
        Ok(())
    }

    /// The share of its backend's limit that each workload reaches.
    fn hold_against_limits(&mut self) {
        let adapter = self.backends.iter().find_map(|backend| backend.adapter.as_ref());
        let on_adapter = adapter.map(|limits| limits.device.flops_per_second);
        for workload in &mut self.workloads {
            let limit = match (workload.backend.as_str(), on_adapter) {
                ("gpu", Some(limit)) => limit,
                _ => self.limits.gemm_all_flops,
            };
            let flops = workload.flops_per_unit * workload.units as f64;
            workload.share = flops / workload.timing.best_seconds / limit;
        }
    }

    /// Times a workload.
    fn add_workload(
        &mut self,
        workload: &Workload,
        backend: &Backend,
        watch: &dyn Watch,
    ) -> Result<()> {
        watch.begin(&workload.name, 1);
        let prepared = workload.prepare(backend)?;
        if let Backend::Gpu(_) = backend {
            // Compiles the kernels, which no later call does.
            prepared.call()?;
        }
        let timing = measure(&self.protocol, || prepared.call())?;
        watch.advance(1)?;
        // Before, between or after failures: these are not the adapter's times.
        if let (Backend::Gpu(_), Some(event)) = (backend, backend.events().first()) {
            self.leave_out(&workload.name, backend, event.to_string());
            return Ok(());
        }
        let units_per_second = workload.units as f64 / timing.median_seconds;
        self.workloads.push(WorkloadRecord {
            name: workload.name.clone(),
            backend: backend.name().to_owned(),
            unit: workload.unit.to_owned(),
            units: workload.units,
            steps_per_unit: workload.steps,
            flops_per_unit: workload.flops,
            timing,
            units_per_second,
            steps_per_second: workload.steps * units_per_second,
            flops_per_second: workload.flops * units_per_second,
            share: 0.0,
            kernels: kernel_times(&prepared, backend)?,
        });
        Ok(())
    }

    /// Runs the batches of growing size.
    fn add_scaling(
        &mut self,
        asked: &Asked,
        backend: &Backend,
        batch: &Batch,
        watch: &dyn Watch,
    ) -> Result<()> {
        if is_software(backend) {
            let reason = "minutes on a software adapter".to_owned();
            self.leave_out(SCALING, backend, reason);
            return Ok(());
        }
        let sizes = if asked.quick { &SIZES[..QUICK_SIZES] } else { &SIZES };
        // A long batch needs no repetition to be measured well.
        let protocol = Protocol { least_calls: 1, ..self.protocol };
        self.scaling.extend(scaling(backend, batch, sizes, &protocol, watch)?);
        Ok(())
    }

    fn leave_out(&mut self, name: &str, backend: &Backend, reason: String) {
        let (name, backend) = (name.to_owned(), backend.name().to_owned());
        self.left_out.push(LeftOutRecord { name, backend, reason });
    }
}

/// Times on the adapter of a call of `workload`.
fn kernel_times(workload: &PreparedWorkload<'_>, backend: &Backend) -> Result<Vec<KernelRecord>> {
    let Backend::Gpu(gpu) = backend else { return Ok(Vec::new()) };
    gpu.time_kernels(true);
    let timed = |_| workload.call().map(|()| gpu.take_kernel_times());
    let calls: Result<Vec<_>> = (0..KERNEL_CALLS).map(timed).collect();
    gpu.time_kernels(false);
    Ok(medians(&calls?))
}

/// The median over `calls` of the time of each kernel.
fn medians(calls: &[Vec<KernelTime>]) -> Vec<KernelRecord> {
    let record = |one: &KernelTime| {
        let same = calls.iter().flatten().filter(|time| time.kernel == one.kernel);
        let mut seconds: Vec<f64> = same.map(|time| time.seconds).collect();
        seconds.sort_by(f64::total_cmp);
        KernelRecord {
            kernel: one.kernel.to_owned(),
            dispatches: one.dispatches,
            seconds: quantile(&seconds, 0.5),
        }
    };
    calls.first().into_iter().flatten().map(record).collect()
}

/// Whether `backend` is an adapter that the processor plays.
fn is_software(backend: &Backend) -> bool {
    match backend {
        Backend::Cpu(_) => false,
        Backend::Gpu(gpu) => gpu.adapter().kind == AdapterKind::Software,
    }
}

/// The machine in words.
fn machine(host: &Cpu) -> MachineRecord {
    MachineRecord {
        cpu: host.model().to_owned(),
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        instructions: host.instructions().to_owned(),
        threads: host.threads(),
        platform: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_kernels_are_medians_of_calls() {
        let call = |seconds| vec![KernelTime { kernel: "sample", dispatches: 2, seconds }];
        let kernels = medians(&[call(9.0), call(1.0), call(2.0)]);
        let found: Vec<_> = kernels.iter().map(|one| (one.dispatches, one.seconds)).collect();
        assert_eq!(found, [(2, 2.0)]);
        assert!(medians(&[]).is_empty());
    }
}
