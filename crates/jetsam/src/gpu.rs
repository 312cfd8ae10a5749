//! The graphics processor, for the stages that have a twin in WGSL.
//!
//! In: nothing. Out: [`devices`], what this machine has, and an open device for the twins. Vulkan on Linux and Windows,
//! Direct3D 12 on Windows, Metal on macOS, all through wgpu; without the feature `gpu` there are no devices. Whatever
//! goes wrong is a [`GpuError`] that names a remedy: a lost device or a full memory never ends the program.

use miette::Diagnostic;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Why a device could not do the work.
#[derive(Clone, Debug, Error, Diagnostic, PartialEq)]
pub enum GpuError {
    /// There is none.
    #[error("no GPU was found")]
    #[diagnostic(
        code(jetsam::gpu::none),
        help(
            "install the vendor's Vulkan driver, or Mesa's software driver (Debian, Ubuntu: apt-get install \
             mesa-vulkan-drivers); the backend `cpu` gives the same result without one"
        )
    )]
    NoAdapter,
    /// This program was built without GPU support.
    #[error("this program was built without GPU support")]
    #[diagnostic(
        code(jetsam::gpu::absent),
        help("build it with the feature `gpu`, which is on by default, or use the backend `cpu`")
    )]
    NotBuilt,
    /// The scene asks for what only the processor does.
    #[error("{what} run on the processor only")]
    #[diagnostic(code(jetsam::gpu::scene), help("use `--backend cpu`, or `auto`, which chooses it by itself"))]
    Scene {
        /// What it asks for.
        what: &'static str,
    },
    /// The driver would not open the device, or refused a command.
    #[error("{device} refused to work: {reason}")]
    #[diagnostic(code(jetsam::gpu::refused), help("update the graphics driver, or use the backend `cpu`"))]
    Refused {
        /// Its name.
        device: String,
        /// What the driver says.
        reason: String,
    },
    /// Something is larger than the device allows.
    #[error("{what} take {needs} bytes, but {device} holds {limit} in one buffer{}", fits(*.count, *.needs, *.limit))]
    #[diagnostic(
        code(jetsam::gpu::limit),
        help("use a larger spacing, a mesh of fewer triangles, or the backend `cpu`")
    )]
    Limit {
        /// What is too large.
        what: &'static str,
        /// How many there are; 0 where that says nothing.
        count: u64,
        /// Their size.
        needs: u64,
        /// The smaller of `max_storage_buffer_binding_size` and `max_buffer_size`.
        limit: u64,
        /// The device's name.
        device: String,
    },
    /// The device's memory is full.
    #[error("{device} is out of memory")]
    #[diagnostic(
        code(jetsam::gpu::memory),
        help("use a larger spacing, end other programs that use the GPU, or use the backend `cpu`")
    )]
    Memory {
        /// Its name.
        device: String,
    },
    /// The device was reset or removed.
    #[error("{device} was lost: {reason}")]
    #[diagnostic(
        code(jetsam::gpu::lost),
        help("try again; if it happens again, update the driver or use the backend `cpu`")
    )]
    Lost {
        /// Its name.
        device: String,
        /// What the driver says.
        reason: String,
    },
}

/// How many of so many items fit into what a device holds, in words.
fn fits(count: u64, needs: u64, limit: u64) -> String {
    if count == 0 {
        return String::new();
    }
    format!(": {} of {count} would fit", (count as f64 * limit as f64 / needs as f64) as u64)
}

/// What kind of device it is, the most welcome first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeviceKind {
    /// A card of its own.
    Discrete,
    /// Shares the processor's memory.
    Integrated,
    /// Lent by a virtual machine.
    Virtual,
    /// The driver does not say.
    Unknown,
    /// A program on the processor that stands in for a GPU.
    Software,
}

/// A device of this machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DeviceInfo {
    /// Its name.
    pub name: String,
    /// What it is.
    pub kind: DeviceKind,
    /// How it is reached: `vulkan`, `metal` or `dx12`.
    pub api: String,
    /// Its driver.
    pub driver: String,
    /// The most bytes a kernel can address in one buffer.
    pub max_buffer_bytes: u64,
}

impl DeviceInfo {
    /// Whether it is a GPU in fact, not a program in its place: those are all the backend `auto` takes.
    pub fn is_hardware(&self) -> bool {
        self.kind < DeviceKind::Unknown
    }

    /// An error unless a buffer of that size can be bound.
    #[cfg(feature = "gpu")]
    pub(crate) fn holds(&self, what: &'static str, needs: u64) -> Result<(), GpuError> {
        self.holds_all(what, 0, needs)
    }

    /// The same of so many items: the error then says how many would fit.
    #[cfg(feature = "gpu")]
    pub(crate) fn holds_all(&self, what: &'static str, count: u64, needs: u64) -> Result<(), GpuError> {
        let limit = self.max_buffer_bytes;
        if needs <= limit {
            return Ok(());
        }
        Err(GpuError::Limit { what, count, needs, limit, device: self.name.clone() })
    }
}

/// The devices of this machine, the most welcome first. Empty without the feature `gpu`.
pub fn devices() -> Vec<DeviceInfo> {
    #[cfg(feature = "gpu")]
    return device::adapters(&instance()).into_iter().map(|(info, _)| info).collect();
    #[cfg(not(feature = "gpu"))]
    return Vec::new();
}

#[cfg(feature = "gpu")]
pub use device::{Gpu, instance};

/// Without GPU support there is no device.
#[cfg(not(feature = "gpu"))]
#[derive(Clone, Debug)]
pub enum Gpu {}

#[cfg(feature = "gpu")]
mod device {
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::{Arc, Mutex};

    use super::{DeviceInfo, DeviceKind, GpuError};

    /// The way to the drivers. Windows make their surfaces from the instance whose adapter is opened for them.
    pub fn instance() -> wgpu::Instance {
        wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle())
    }

    /// All adapters, the most welcome first.
    pub fn adapters(instance: &wgpu::Instance) -> Vec<(DeviceInfo, wgpu::Adapter)> {
        let found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
        let mut adapters: Vec<_> = found.into_iter().map(|a| (describe(&a), a)).collect();
        adapters.sort_by_key(|(info, _)| info.kind);
        adapters
    }

    fn describe(adapter: &wgpu::Adapter) -> DeviceInfo {
        let info = adapter.get_info();
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => DeviceKind::Discrete,
            wgpu::DeviceType::IntegratedGpu => DeviceKind::Integrated,
            wgpu::DeviceType::VirtualGpu => DeviceKind::Virtual,
            wgpu::DeviceType::Cpu => DeviceKind::Software,
            wgpu::DeviceType::Other => DeviceKind::Unknown,
        };
        DeviceInfo {
            name: info.name,
            kind,
            api: info.backend.to_str().to_string(),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_string(),
            max_buffer_bytes: largest(&adapter.limits()),
        }
    }

    fn largest(limits: &wgpu::Limits) -> u64 {
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// An open device, shared by simulation, pictures and window.
    #[derive(Clone, Debug)]
    pub struct Gpu {
        /// What it is.
        pub info: DeviceInfo,
        /// The device.
        pub device: wgpu::Device,
        /// Where its commands go.
        pub queue: wgpu::Queue,
        /// Why it was lost, once it was.
        lost: Arc<Mutex<Option<String>>>,
    }

    impl Gpu {
        /// Opens the most welcome device, with all the limits it has; only hardware if so asked.
        ///
        /// # Errors
        /// No such device, or one that refuses.
        pub fn open(only_hardware: bool) -> Result<Gpu, GpuError> {
            Self::open_where(&instance(), |info, _| info.is_hardware() || !only_hardware)
        }

        /// Opens the most welcome device, if only a software one, whose pictures can be shown on a surface of `instance`.
        ///
        /// # Errors
        /// No such device, or one that refuses.
        pub fn open_for(
            instance: &wgpu::Instance,
            surface: &wgpu::Surface,
        ) -> Result<(Gpu, wgpu::SurfaceCapabilities), GpuError> {
            let mut capabilities = None;
            let gpu = Self::open_where(instance, |_, adapter| {
                let found = surface.get_capabilities(adapter);
                let fits = adapter.is_surface_supported(surface) && !found.formats.is_empty();
                capabilities = fits.then_some(found);
                fits
            })?;
            Ok((gpu, capabilities.ok_or(GpuError::NoAdapter)?))
        }

        fn open_where(
            instance: &wgpu::Instance,
            mut fits: impl FnMut(&DeviceInfo, &wgpu::Adapter) -> bool,
        ) -> Result<Gpu, GpuError> {
            let (info, adapter) = adapters(instance)
                .into_iter()
                .find(|(info, adapter)| fits(info, adapter))
                .ok_or(GpuError::NoAdapter)?;
            let wish = wgpu::DeviceDescriptor {
                label: Some("jetsam"),
                required_features: adapter.features() & wgpu::Features::TIMESTAMP_QUERY,
                required_limits: adapter.limits(),
                ..Default::default()
            };
            let opened = pollster::block_on(adapter.request_device(&wish));
            let (device, queue) =
                opened.map_err(|e| GpuError::Refused { device: info.name.clone(), reason: e.to_string() })?;
            let lost = Arc::new(Mutex::new(None));
            let note = lost.clone();
            device.set_device_lost_callback(move |why, message| {
                if let Ok(mut note) = note.lock() {
                    *note = Some(format!("{message} ({why:?})"));
                }
            });
            Ok(Gpu { info, device, queue, lost })
        }

        /// Does some work on the device and tells what went wrong on the way. Here wgpu's errors come out, whichever way
        /// they take: error scopes, the callback of a lost device, or a panic where wgpu has no other.
        ///
        /// # Errors
        /// Those of `work`, and what the device says.
        pub fn attempt<T>(&self, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
            use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
            let scopes = [OutOfMemory, Internal, Validation].map(|f| self.device.push_error_scope(f));
            let outcome = catch_unwind(AssertUnwindSafe(work))
                .unwrap_or_else(|_| Err(self.refused("its driver, or wgpu, panicked")));
            // Every scope has to be closed, the last first.
            let caught: Vec<wgpu::Error> =
                scopes.into_iter().rev().filter_map(|scope| pollster::block_on(scope.pop())).collect();
            if outcome.is_ok() && caught.is_empty() {
                return outcome;
            }
            // The callback of a lost device runs no sooner than the device is asked; an answer is not wanted.
            let _ = catch_unwind(AssertUnwindSafe(|| self.device.poll(wgpu::PollType::Poll)));
            let device = self.info.name.clone();
            if let Some(reason) = self.lost.lock().ok().and_then(|note| note.clone()) {
                return Err(GpuError::Lost { device, reason });
            }
            // Running out of memory entails errors of other kinds.
            let memory = |e: &wgpu::Error| matches!(e, wgpu::Error::OutOfMemory { .. });
            if caught.iter().any(memory) {
                return Err(GpuError::Memory { device });
            }
            match caught.first() {
                Some(error) => Err(self.refused(error)),
                None => outcome,
            }
        }

        /// The error of a command that was refused.
        pub fn refused(&self, reason: impl ToString) -> GpuError {
            GpuError::Refused { device: self.info.name.clone(), reason: reason.to_string() }
        }
    }
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_named() {
        let info = DeviceInfo {
            name: "a card".into(),
            kind: DeviceKind::Discrete,
            api: "vulkan".into(),
            driver: String::new(),
            max_buffer_bytes: 128 << 20,
        };
        assert!(info.is_hardware() && info.holds("vertices", 128 << 20).is_ok());
        let fault = info.holds("vertices", (128 << 20) + 1).unwrap_err();
        assert_eq!(fault.to_string(), "vertices take 134217729 bytes, but a card holds 134217728 in one buffer");
        assert!(fault.help().is_some());
        let fault = info.holds_all("particles", 8 << 20, 256 << 20).unwrap_err();
        assert!(fault.to_string().ends_with(": 4194304 of 8388608 would fit"), "{fault}");
    }
}
