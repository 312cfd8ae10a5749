//! What a scene should come out as: `[[expect]]` and `[[variant]]` blocks. [`crate::validate`] judges them.

use crate::formula::Formula;
use crate::params::default as d;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What kind of case a scene is.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Validation {
    /// Number of the case, as in `A5`.
    pub id: String,
    /// Whether it takes a few seconds at most: `cargo test` runs it.
    #[serde(default)]
    pub quick: bool,
    /// What a reader of the report should know.
    #[serde(default)]
    pub notes: String,
}

/// One run of a scene that is run several times, each with other values.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Name.
    pub name: String,
    /// Values to override, `path=value` as with `--set`.
    #[serde(default)]
    pub set: Vec<String>,
    /// What is expected of this run alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub expect: Vec<Expect>,
}

/// What a probe should show, and how far it may be off.
///
/// A number is taken from the probe's course (`time`, or `window` and `take`), or the course is compared with a `curve`. It
/// is judged by `value` with `tolerance` or `relative`, or by `at_most` and `at_least`.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    /// Name of the probe.
    pub probe: String,
    /// What the table says it is; by default made of the probe's name and `take`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub what: Option<String>,
    /// The value at this time (s), between two readings on a straight line.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time: Option<Formula>,
    /// From when to when (s); the whole run when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub window: Option<[Formula; 2]>,
    /// What is taken from the course in the window.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub take: Option<Take>,
    /// The level of `first-above`, `first-below`, `time-above` and `period` (for the latter the mean when absent).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub level: Option<Formula>,
    /// Which crest, counted from 1.
    #[serde(default = "d::crest")]
    pub nth: f64,
    /// How far the course must fall after a crest, and have risen before it, for it to count; a tenth of the range in the
    /// window when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prominence: Option<Formula>,
    /// The course itself: pairs of time and value.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<[f64; 2]>,
    /// The course itself from a CSV file, two columns without or with a header; lines with `#` are comments.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<String>,
    /// Which columns of the file hold time and value, counted from 1.
    #[serde(default = "first_two")]
    pub columns: [f64; 2],
    /// Factors on the curve's times and values, and after them offsets.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scale: Vec<Formula>,
    /// How far the curve may be moved in time, either way, to fit best (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<Formula>,
    /// What it should be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<Formula>,
    /// How far it may be off; for a curve, the largest error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance: Option<Formula>,
    /// How far it may be off as a fraction of the value; for a curve, of its largest value.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative: Option<f64>,
    /// The largest it may be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<Formula>,
    /// The smallest it may be.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_least: Option<Formula>,
    /// Where the expected value comes from: a paper, a formula.
    pub source: String,
    /// Whether the verdict counts; if not, the number is only reported.
    #[serde(default = "super::yes")]
    pub gate: bool,
    /// Only of these variants; of every run when absent.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub variants: Vec<String>,
    /// The same number taken from several runs, made into one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub compare: Option<Compare>,
    /// For an order of convergence: how much finer each variant is than the one before.
    #[serde(default = "d::refinement")]
    pub refinement: f64,
}

fn first_two() -> [f64; 2] {
    [1.0, 2.0]
}

/// One number made of those of several variants.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compare {
    /// How.
    pub by: By,
    /// Of which variants.
    pub of: Vec<String>,
    /// What would be exact: subtracted from each number first. An order of convergence needs it, or three variants.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exact: Option<Formula>,
}

/// How numbers of several variants become one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum By {
    /// The first less the second.
    Difference,
    /// The first over the second.
    Ratio,
    /// Largest less smallest.
    Spread,
    /// Mean.
    Mean,
    /// Median: of runs that end in one of two states, what the more frequent is like.
    Median,
    /// Order of convergence: logarithm of the ratio of the first error to the second, to the base of the refinement. Of
    /// three variants without an exact value: from their differences (Richardson).
    Order,
}

/// What is taken from the course of a probe in a window of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Take {
    /// The last value.
    Final,
    /// The first value.
    First,
    /// Mean over time.
    Mean,
    /// Smallest value.
    Min,
    /// Largest value.
    Max,
    /// Largest magnitude.
    Largest,
    /// Root of the mean square over time.
    Rms,
    /// Standard deviation over time.
    Noise,
    /// Largest less smallest value.
    Spread,
    /// Integral over time.
    Integral,
    /// Slope of the straight line of least squares (1/s).
    Slope,
    /// Last value less the first.
    Drift,
    /// Mean time between upward passages through the level (s).
    Period,
    /// When the value first rises above the level (s).
    FirstAbove,
    /// When the value first falls below the level (s).
    FirstBelow,
    /// How long the value is above the level (s).
    TimeAbove,
    /// When the n-th crest comes (s).
    CrestTime,
    /// How high it is.
    CrestHeight,
    /// Largest distance from the curve.
    MaxError,
    /// Mean distance from the curve.
    MeanError,
    /// Root mean square of the distance from the curve.
    RmsError,
}

impl Take {
    /// The word used in scene files.
    pub fn word(self) -> String {
        serde_json::to_value(self).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
    }
}
