//! The kernels of each stage, in their order, and how often they run.

use super::layout::BLOCK;
use super::program::{hoses, mortal};
use crate::model::Model;
use crate::scene::{Coupling, Pressure};
use crate::stage::Stage;

/// Over what a kernel runs, and how many invocations make a workgroup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Over {
    /// Places of fluid particles.
    Fluids(u32),
    /// Particles of all bodies.
    BodyParticles(u32),
    /// Slots of rigid bodies.
    Slots(u32),
    /// Places of fluids and slots of rigid bodies.
    Moving(u32),
    /// Cells of fluids and of rigid bodies.
    Cells(u32),
    /// Blocks of cells.
    Blocks,
    /// Bodies.
    Bodies(u32),
    /// Those that have rigid slots.
    Movers(u32),
    /// Parts of bodies, those of 128 slots to a workgroup.
    Parts,
    /// Those of rigid slots.
    RigidParts,
    /// Groups of the ledger.
    Groups,
    /// Agents.
    Agents(u32),
    /// Cells of agents, flock by flock.
    AgentCells(u32),
    /// Places of fluids and particles of all bodies.
    Particles(u32),
    /// Births of a frame.
    Births(u32),
    /// Elements of the coarse level of implicit pressure.
    Elements(u32),
    /// Those that hold particles: workgroups take one after another.
    Occupied,
    /// Its nodes.
    Nodes(u32),
    /// Bodies that have rigid slots, one to a workgroup.
    EachMover,
    /// One workgroup.
    One,
}

/// How often the kernels of a section run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Times {
    /// Once.
    Once,
    /// As many pairs of rounds as the solve of that number in a step needs.
    Rounds(usize),
    /// For each part of a step of bodies but the last.
    Parts,
}

/// Kernels in their order, and how often they run.
pub type Section = (Times, &'static [(&'static str, Over)]);

/// What bodies do before they are drifted, and what makes their slots follow.
const DRIFT_BODIES: [(&str, Over); 3] =
    [("half_kick_bodies", Over::Bodies(64)), ("joints_drift", Over::One), ("drift_bodies", Over::Bodies(64))];
/// A round of shares that push fluids and bodies.
const ROUND: [(&str, Over); 7] = [
    ("accelerate", Over::Fluids(128)),
    ("press_rigid", Over::Slots(128)),
    ("thrust_parts", Over::RigidParts),
    ("thrust_bodies", Over::Movers(64)),
    ("push_bodies", Over::Slots(128)),
    ("relax", Over::Fluids(128)),
    ("judge", Over::One),
];
/// Two of them; between them the coarse level, if it is due.
const ROUNDS: &[(&str, Over)] = &[
    ROUND[0],
    ROUND[1],
    ROUND[2],
    ROUND[3],
    ROUND[4],
    ROUND[5],
    ROUND[6],
    ("coarse_push", Over::Fluids(128)),
    ("coarse_elements", Over::Occupied),
    ("coarse_bodies", Over::EachMover),
    ("coarse_press", Over::Slots(128)),
    ("coarse_reach", Over::Slots(128)),
    ("coarse_nodes", Over::Nodes(128)),
    ("coarse_solve", Over::One),
    ("coarse_add", Over::Fluids(128)),
    ROUND[0],
    ROUND[1],
    ROUND[2],
    ROUND[3],
    ROUND[4],
    ROUND[5],
    ROUND[6],
];
/// Two rounds of places.
const ROUNDS_OF_PLACES: &[(&str, Over)] = &[ROUND[0], ROUND[5], ROUND[6], ROUND[0], ROUND[5], ROUND[6]];
/// What follows its rounds, walls too.
const PUSHED: [(&str, Over); 7] = [
    ("close", Over::One),
    ("finish", Over::Fluids(128)),
    ("accelerate", Over::Fluids(128)),
    ("press_all", Over::BodyParticles(128)),
    ("thrust_parts", Over::Parts),
    ("thrust_bodies", Over::Bodies(64)),
    ("push_bodies", Over::Slots(128)),
];
/// Links of a turn of PBF, and whether it is needed.
const TURN: &[(&str, Over)] = &[("links", Over::Fluids(128)), ("begin_turn", Over::One), ("seat", Over::Moving(128))];
const TURNED: &[(&str, Over)] = &[
    PUSHED[0],
    PUSHED[1],
    PUSHED[2],
    PUSHED[3],
    PUSHED[4],
    PUSHED[5],
    ("shift_fluid", Over::Fluids(128)),
    ("shift_bodies", Over::Bodies(64)),
    ("shift_slots", Over::Slots(128)),
];

/// The sections of a stage, in their order. `choose` stands before the first stage.
pub fn sections(stage: Stage, solver: Pressure) -> &'static [Section] {
    use Over::*;
    use Times::{Once, Parts, Rounds};
    match (stage, solver) {
        (Stage::Drift, Pressure::Dfsph | Pressure::Pbf) => &[
            (Once, &[("glide", Fluids(128)), ("steady_bodies", Bodies(64))]),
            (
                Parts,
                &[
                    ("part", One),
                    ("half_kick_bodies", Movers(64)),
                    ("joints_drift", One),
                    ("drift_bodies", Movers(64)),
                    ("follow_part", Slots(128)),
                    ("straying", One),
                    ("touch_bodies", Slots(128)),
                    ("sum_parts", RigidParts),
                    ("sum_bodies", Movers(64)),
                    ("joints_pull", One),
                    ("end_part", Movers(64)),
                    ("joints_kick", One),
                ],
            ),
            (Once, &[("last_part", One), DRIFT_BODIES[0], DRIFT_BODIES[1], DRIFT_BODIES[2], ("follow", Slots(128))]),
        ],
        (Stage::Drift, _) => &[(
            Once,
            &[("drift_fluid", Fluids(128)), DRIFT_BODIES[0], DRIFT_BODIES[1], DRIFT_BODIES[2], ("follow", Slots(128))],
        )],
        (Stage::Cells, _) => &[(
            Once,
            &[
                ("clear", Cells(256)),
                ("histogram", Moving(256)),
                ("scan_blocks", Blocks),
                ("scan_tops", One),
                ("scan_add", Cells(256)),
                ("scatter", Moving(256)),
                ("gather", Moving(256)),
            ],
        )],
        (Stage::Density, _) => &[(Once, &[("density", Fluids(128))])],
        (Stage::Divergence, _) => &[
            (
                Once,
                &[
                    ("begin_velocities", One),
                    ("coarse_window", Cells(256)),
                    ("coarse_occupied", Elements(256)),
                    ("links", Fluids(128)),
                    ("seat", Moving(128)),
                    ("flow_of_bodies", Slots(128)),
                    ("errors_of_velocities", Fluids(128)),
                    ("velocities", One),
                ],
            ),
            (Rounds(0), ROUNDS),
            (Once, &PUSHED),
            (Once, &[("load_bodies", Bodies(64)), ("take_velocities", Fluids(128))]),
        ],
        (Stage::Pressure, Pressure::Dfsph) => &[
            (Once, &[("begin_places", One), ("errors_of_places", Moving(128))]),
            (Rounds(1), ROUNDS_OF_PLACES),
            (Once, &[("close", One), ("finish", Fluids(128)), ("accelerate", Fluids(128))]),
        ],
        (Stage::Pressure, Pressure::Pbf) => &[
            (Once, &[("begin_turns", One), ("coarse_window", Cells(256)), ("coarse_occupied", Elements(256))]),
            (Once, TURN),
            (Rounds(0), ROUNDS),
            (Once, TURNED),
            (Once, TURN),
            (Rounds(1), ROUNDS),
            (Once, TURNED),
            (Once, TURN),
            (Rounds(2), ROUNDS),
            (Once, TURNED),
            (Once, &[("links", Fluids(128)), ("begin_turn", One), ("straying", One), ("keep_inside", Fluids(128))]),
        ],
        (Stage::Pressure, _) => &[(Once, &[("pressure", Fluids(128))])],
        (Stage::Boundary, _) => &[(Once, &[("boundary", BodyParticles(128))])],
        (Stage::Gradients, _) => &[(Once, &[("gradients", Fluids(128))])],
        (Stage::Forces, _) => &[(
            Once,
            &[("forces_fluid", Fluids(128)), ("forces_body", BodyParticles(128)), ("hold_hoses", Fluids(128))],
        )],
        (Stage::Bodies, Pressure::Dfsph | Pressure::Pbf) => &[(
            Once,
            &[
                ("sum_parts", Over::Parts),
                ("sum_bodies", Bodies(64)),
                ("joints_pull", One),
                ("end_part", Bodies(64)),
                ("joints_kick", One),
            ],
        )],
        (Stage::Bodies, _) => {
            &[(Once, &[("sum_parts", Over::Parts), ("sum_bodies", Bodies(64)), ("joints_pull", One)])]
        }
        (Stage::Kick, Pressure::Dfsph | Pressure::Pbf) => {
            &[(Once, &[("push_fluid", Fluids(128)), ("unload_bodies", Bodies(64))])]
        }
        (Stage::Kick, _) => {
            &[(Once, &[("kick_fluid", Fluids(128)), ("kick_bodies", Bodies(64)), ("joints_kick", One)])]
        }
        (Stage::Ledger, _) => {
            &[(Once, &[("tally", Groups), ("tally_bodies", Groups), ("tally_agents", Agents(128)), ("total", One)])]
        }
        (Stage::Agents, _) => &[(
            Once,
            &[
                ("travel", Agents(64)),
                ("crowd_clock", One),
                ("agent_bounds", Agents(256)),
                ("agent_grid", One),
                ("agent_clear", AgentCells(256)),
                ("agent_histogram", Agents(256)),
                ("agent_scan_blocks", AgentCells(BLOCK)),
                ("agent_scan_tops", One),
                ("agent_scan_add", AgentCells(256)),
                ("agent_scatter", Agents(256)),
                ("agent_gather", Agents(256)),
                ("decide", Agents(64)),
                ("give", Particles(128)),
            ],
        )],
        (Stage::Sources, _) => &[(Once, &[("room", Births(64)), ("bear", One), ("drain", Fluids(128))])],
    }
}

/// Whether a kernel has anything to do in a scene.
pub fn wanted(name: &str, model: &Model, bodies: bool) -> bool {
    match name {
        "gradients" => model.wants_gradients(),
        "room" | "bear" => !model.sources.is_empty(),
        "drain" => !model.drains.is_empty() || mortal(model),
        "boundary" => bodies && (!model.implicit() || model.no_slip),
        "hold_hoses" => hoses(model).next().is_some(),
        "give" => model.flocks.iter().any(|f| f.matter.is_some()),
        // part of `drift_bodies` where there is nothing between
        "half_kick_bodies" => !model.joints.is_empty(),
        name if name.starts_with("joint") => !model.joints.is_empty(),
        "travel" | "crowd_clock" | "decide" => !model.flocks.is_empty(),
        name if name.contains("agent") => !model.flocks.is_empty(),
        "straying" => bodies,
        "coarse_bodies" | "coarse_press" | "coarse_reach" => {
            model.coarse() && bodies && model.solver.coupling == Coupling::Pressure
        }
        name if name.starts_with("coarse") => model.coarse(),
        _ => bodies || !(name.contains("bod") || name.contains("part")),
    }
}
