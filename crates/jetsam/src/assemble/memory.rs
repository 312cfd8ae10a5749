//! Memory: what a scene needs is compared with what the machine has before anything is taken.

/// Bytes a particle takes, neighbour lists included, at about 30 neighbours.
pub(super) const BYTES_PER_PARTICLE: f64 = 600.0;
/// Bytes a cell takes (three kinds, counters of two threads).
pub(super) const BYTES_PER_CELL: f64 = 24.0;

/// Memory left on this machine (GB); infinite where the system does not say.
pub(super) fn available_gigabytes() -> f64 {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    match system.available_memory() {
        0 => f64::INFINITY,
        bytes => bytes as f64 / 1e9,
    }
}

/// Whether so many bytes can be had; else what is needed and what there is, in GB.
pub(super) fn check_available(bytes: f64) -> Result<(), (f64, f64)> {
    let have = available_gigabytes();
    if bytes / 1e9 <= 0.9 * have { Ok(()) } else { Err((bytes / 1e9, have)) }
}
