//! Scenes of several tests.

/// Water with boxes in it, that touch each other and the floor.
pub const TANK: &str = r#"
[domain]
min = [0, 0, 0]
max = [0.6, 0.4, 0.8]
[resolution]
spacing = 0.04
[[fluid]]
name = "water"
density = 1000
viscosity = 0.1
shape = { box = { min = [0, 0, 0], max = [0.6, 0.4, 0.3] } }
velocity = [0.3, 0.1, -0.2]
[[rigid]]
name = "light"
density = 400
shape = { box = { min = [0.1, 0.1, 0.1], max = [0.26, 0.26, 0.22] } }
spin = [1, 2, 3]
friction = 0.5
[[rigid]]
name = "on it"
density = 2000
shape = { box = { min = [0.14, 0.1, 0.225], max = [0.3, 0.26, 0.34] } }
velocity = [0.2, 0, -0.5]
friction = 0.3
"#;

/// Balls and bricks that lie on each other and rub.
pub const HEAP: &str = r#"
[domain]
min = [0, 0, 0]
max = [0.3, 0.16, 0.3]
[resolution]
spacing = 0.02
[solver]
sleep = 0
[[rigid]]
name = "ball"
shape = { points = [[0, 0, 0]] }
mass = 0.01
position = [0.02, 0.013, 0.011]
velocity = [0.3, 0.2, -0.1]
stiffness = 2000
copies = { count = 40, grid = { columns = [5, 4], step = [0.0217, 0.0193, 0.0195] } }
[[rigid]]
name = "brick"
shape = { box = { min = [0, 0, 0], max = [0.06, 0.06, 0.04] } }
density = 1500
position = [0.15, 0.03, 0.0]
velocity = [-0.3, 0.1, -0.1]
copies = { count = 3, grid = { columns = [1, 1], step = [0.05, 0.02, 0.041] } }
"#;

/// Periodic water and oil with everything that can be asked of pairs.
pub const LAWS: &str = r#"
[domain]
min = [0, 0, 0]
max = [0.4, 0.4, 0.6]
walls = ["periodic", "solid", "open"]
[resolution]
spacing = 0.04
[solver]
density = "continuity"
shifting = 1.0
xsph = 0.2
vorticity = 0.05
settle = 0.0
[[fluid]]
name = "water"
density = 1000
viscosity = 0.5
surface_tension = 0.07
shape = { box = { min = [0, 0, 0.1], max = [0.4, 0.4, 0.3] } }
velocity = [0.4, 0.1, -0.2]
[[fluid]]
name = "oil"
density = 800
viscosity = 2
surface_tension = 0.03
shape = { box = { min = [0, 0, 0.3], max = [0.4, 0.4, 0.4] } }
velocity = [-0.4, 0.1, 0.2]
[[force]]
vortex = { center = [0.2, 0.2, 0.2], axis = [0, 0, 1], speed = 1.0, core = 0.1, rate = 2.0 }
[[force]]
point = { center = [0.2, 0.2, 0.5], strength = 0.1, core = 0.2 }
"#;

pub const FLAT: &str = r#"
[world]
dimensions = 2
[domain]
min = [0, 0, 0]
max = [1.0, 0, 0.8]
[resolution]
spacing = 0.025
[[fluid]]
name = "water"
viscosity = 0.1
shape = { box = { min = [0, 0, 0], max = [0.5, 0, 0.4] } }
[[rigid]]
name = "box"
density = 500
shape = { box = { min = [0.6, 0, 0.001], max = [0.8, 0, 0.2] } }
spin = [0, 2, 0]
"#;
