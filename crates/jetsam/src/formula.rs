//! Formulas in scene files: `"-U * exp(b*t) * cos(2*pi*x)"`.
//!
//! In: a [`Formula`] (a number, or a text) of a scene and the names it may use: the scene's `[constants]`, `pi`, `dx`,
//! and what the place it stands at offers (`x`, `y`, `z`, `t`, probes). Out: an [`Expression`] that is evaluated as often
//! as wanted. Powers bind as on paper: `-x^2` is `-(x^2)`, `2^3^2` is `2^9`. A name that holds a hyphen is put in
//! braces: `{gauge-1} / H`.

use crate::error::Result;
use crate::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// A number, or a formula in quotes.
///
/// Operators `+ - * / ^`; functions `sin cos tan asin acos atan atan2 sinh cosh tanh exp ln log sqrt cbrt abs sign floor
/// min max mod if`, where `log` has base 10 and `if(c, a, b)` is `a` where `c > 0`, else `b`; names are those of
/// `[constants]`, `pi`, `dx`, and what the key says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a number, or a formula in quotes, is needed")]
pub enum Formula {
    /// A number.
    Number(f64),
    /// A formula.
    Text(String),
}

impl From<f64> for Formula {
    fn from(x: f64) -> Self {
        Self::Number(x)
    }
}

impl From<&str> for Formula {
    fn from(text: &str) -> Self {
        Self::Text(text.into())
    }
}

/// What is wrong with a formula.
#[derive(Clone, Debug, PartialEq)]
pub struct Flaw {
    /// What is wrong.
    pub message: String,
    /// What to do about it.
    pub help: String,
    /// The name that nobody knows, if that is the flaw.
    pub unknown: Option<String>,
}

#[derive(Clone, Copy, Debug)]
enum Op {
    Number(f64),
    Name(usize),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Power,
    One(One),
    Two(Two),
    If,
}

/// A formula ready to be evaluated.
#[derive(Clone, Debug)]
pub struct Expression {
    code: Vec<Op>,
}

type One = fn(f64) -> f64;
type Two = fn(f64, f64) -> f64;

/// Functions of one argument.
const ONE: &[(&str, One)] = &[
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("asin", f64::asin),
    ("acos", f64::acos),
    ("atan", f64::atan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("exp", f64::exp),
    ("ln", f64::ln),
    ("log", f64::log10),
    ("sqrt", f64::sqrt),
    ("cbrt", f64::cbrt),
    ("abs", f64::abs),
    ("sign", sign),
    ("floor", f64::floor),
];

/// Functions of two arguments.
const TWO: &[(&str, Two)] = &[("min", f64::min), ("max", f64::max), ("mod", f64::rem_euclid), ("atan2", f64::atan2)];

fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// Brackets and signs may be nested this deep.
const DEEPEST: usize = 64;

impl Expression {
    /// Reads a formula; `names` are the ones it may use, in the order of the values given to [`Expression::eval`].
    ///
    /// # Errors
    /// A [`Flaw`]: a syntax error with its column, or a name that is not known.
    pub fn parse(text: &str, names: &[&str]) -> std::result::Result<Self, Flaw> {
        let mut reader = Reader { text, at: 0, depth: 0, names, code: Vec::new() };
        reader.sum()?;
        match reader.peek() {
            None => Ok(Self { code: reader.code }),
            Some(c) => Err(reader.flaw(format!("`{c}` is not expected here"), "write an operator between two values")),
        }
    }

    /// The value where the names have these values.
    pub fn eval(&self, values: &[f64]) -> f64 {
        let mut stack: Vec<f64> = Vec::with_capacity(8);
        let pop = |stack: &mut Vec<f64>| stack.pop().unwrap_or(f64::NAN);
        for op in &self.code {
            let value = match *op {
                Op::Number(x) => x,
                Op::Name(i) => values[i],
                Op::Negate => -pop(&mut stack),
                Op::One(f) => f(pop(&mut stack)),
                Op::If => {
                    let (no, yes, c) = (pop(&mut stack), pop(&mut stack), pop(&mut stack));
                    if c > 0.0 { yes } else { no }
                }
                _ => {
                    let (b, a) = (pop(&mut stack), pop(&mut stack));
                    match *op {
                        Op::Add => a + b,
                        Op::Subtract => a - b,
                        Op::Multiply => a * b,
                        Op::Divide => a / b,
                        Op::Power => a.powf(b),
                        Op::Two(f) => f(a, b),
                        _ => unreachable!("every other operation is handled above"),
                    }
                }
            };
            stack.push(value);
        }
        pop(&mut stack)
    }

    /// Indices of the names that are used.
    pub fn uses(&self) -> impl Iterator<Item = usize> + '_ {
        self.code.iter().filter_map(|op| if let Op::Name(i) = op { Some(*i) } else { None })
    }
}

/// Recursive descent: sum > product > sign > power > value.
struct Reader<'a> {
    text: &'a str,
    at: usize,
    depth: usize,
    names: &'a [&'a str],
    code: Vec<Op>,
}

impl Reader<'_> {
    fn flaw(&self, message: String, help: &str) -> Flaw {
        let column = 1 + self.text[..self.at].chars().count();
        let message = format!("the formula `{}`, column {column}: {message}", self.text);
        Flaw { message, help: help.into(), unknown: None }
    }

    fn peek(&mut self) -> Option<char> {
        let rest = &self.text[self.at..];
        self.at += rest.len() - rest.trim_start().len();
        self.text[self.at..].chars().next()
    }

    fn take(&mut self, c: char) -> bool {
        let found = self.peek() == Some(c);
        if found {
            self.at += c.len_utf8();
        }
        found
    }

    fn expect(&mut self, c: char) -> std::result::Result<(), Flaw> {
        if self.take(c) { Ok(()) } else { Err(self.flaw(format!("`{c}` is missing"), "close what was opened")) }
    }

    fn sum(&mut self) -> std::result::Result<(), Flaw> {
        self.product()?;
        loop {
            let op = match self.peek() {
                Some('+') => Op::Add,
                Some('-') => Op::Subtract,
                _ => return Ok(()),
            };
            self.at += 1;
            self.product()?;
            self.code.push(op);
        }
    }

    fn product(&mut self) -> std::result::Result<(), Flaw> {
        self.signed()?;
        loop {
            let op = match self.peek() {
                Some('*') => Op::Multiply,
                Some('/') => Op::Divide,
                _ => return Ok(()),
            };
            self.at += 1;
            self.signed()?;
            self.code.push(op);
        }
    }

    fn signed(&mut self) -> std::result::Result<(), Flaw> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(self.flaw("it is nested too deep".into(), "split it with [constants] or `formula` probes"));
        }
        if self.take('-') {
            self.signed()?;
            self.code.push(Op::Negate);
        } else {
            self.take('+');
            self.value()?;
            if self.take('^') {
                self.signed()?;
                self.code.push(Op::Power);
            }
        }
        self.depth -= 1;
        Ok(())
    }

    fn value(&mut self) -> std::result::Result<(), Flaw> {
        match self.peek() {
            Some('(') => {
                self.at += 1;
                self.sum()?;
                self.expect(')')
            }
            Some('{') => {
                self.at += 1;
                let rest = &self.text[self.at..];
                let Some(end) = rest.find('}') else { return self.expect('}') };
                self.at += end + 1;
                self.name(rest[..end].trim())
            }
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => {
                let rest = &self.text[self.at..];
                let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_')).unwrap_or(rest.len());
                let word = &rest[..end];
                self.at += end;
                if self.take('(') { self.call(word) } else { self.name(word) }
            }
            Some(c) => Err(self.flaw(format!("`{c}` is not expected here"), "write a number, a name or a bracket")),
            None => Err(self.flaw("it ends too early".into(), "write a number, a name or a bracket")),
        }
    }

    fn number(&mut self) -> std::result::Result<(), Flaw> {
        let bytes = self.text.as_bytes();
        let digits = |mut at: usize| {
            while at < bytes.len() && (bytes[at].is_ascii_digit() || bytes[at] == b'.') {
                at += 1;
            }
            at
        };
        let mut end = digits(self.at);
        if matches!(bytes.get(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
            if bytes.get(end + 1 + sign).is_some_and(u8::is_ascii_digit) {
                end = digits(end + 1 + sign);
            }
        }
        let Ok(number) = self.text[self.at..end].parse() else {
            return Err(self.flaw(format!("`{}` is no number", &self.text[self.at..end]), "write it like 1.5 or 2e-3"));
        };
        self.at = end;
        self.code.push(Op::Number(number));
        Ok(())
    }

    fn name(&mut self, name: &str) -> std::result::Result<(), Flaw> {
        if let Some(i) = self.names.iter().position(|n| *n == name) {
            self.code.push(Op::Name(i));
            return Ok(());
        }
        let help = match nearest(name, self.names.iter().copied()) {
            Some(known) => format!("did you mean `{known}`? "),
            None => String::new(),
        };
        let help = format!("{help}known here: {}; give others in [constants]", self.names.join(", "));
        let flaw = self.flaw(format!("`{name}` is not known"), &help);
        Err(Flaw { unknown: Some(name.into()), ..flaw })
    }

    fn call(&mut self, name: &str) -> std::result::Result<(), Flaw> {
        let one = ONE.iter().find(|f| f.0 == name).map(|f| (Op::One(f.1), 1));
        let two = TWO.iter().find(|f| f.0 == name).map(|f| (Op::Two(f.1), 2));
        let three = (name == "if").then_some((Op::If, 3));
        let Some((op, arguments)) = one.or(two).or(three) else {
            let all = ONE.iter().map(|f| f.0).chain(TWO.iter().map(|f| f.0)).chain(["if"]);
            let near = nearest(name, all.clone()).map_or(String::new(), |n| format!("did you mean `{n}`? "));
            let help = format!("{near}there are {}", all.collect::<Vec<_>>().join(", "));
            return Err(self.flaw(format!("there is no function `{name}`"), &help));
        };
        for k in 0..arguments {
            if k > 0 {
                self.expect(',')?;
            }
            self.sum()?;
        }
        self.expect(')')?;
        self.code.push(op);
        Ok(())
    }
}

/// The known word most like a wrong one, if any is alike.
pub fn nearest<'a>(wrong: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let score = |k: &&str| (strsim::jaro_winkler(wrong, k) * 1e6) as u64;
    known.max_by_key(score).filter(|k| score(k) > 700_000)
}

/// The constants of a scene with their values: what every formula may use.
#[derive(Clone, Debug)]
pub struct Scope {
    names: Vec<String>,
    values: Vec<f64>,
}

impl Scope {
    /// The scene's `[constants]`, `pi` and `dx`.
    ///
    /// # Errors
    /// A constant whose formula is wrong, refers to itself, or is named as something that formulas know already.
    pub fn of(scene: &Scene) -> Result<Self> {
        let mut scope = Self { names: vec!["pi".into(), "dx".into()], values: vec![PI, scene.resolution.spacing] };
        let mut waiting: Vec<(&String, &Formula)> = scene.constants.iter().collect();
        for (name, _) in &waiting {
            if ["pi", "dx", "x", "y", "z", "t"].contains(&name.as_str()) {
                let message = format!("the constant `{name}` has a name that formulas know already");
                return Err(scene.error(&format!("constants.{name}"), message, "choose another name"));
            }
        }
        while !waiting.is_empty() {
            let mut later = Vec::new();
            let before = waiting.len();
            for (name, formula) in waiting {
                let path = format!("constants.{name}");
                let is_constant = |n: &String| scene.constants.contains_key(n);
                match scope.parse(formula, &[]) {
                    Ok(expression) => {
                        let value = scope.finite(scene, &path, &expression)?;
                        scope.names.push(name.clone());
                        scope.values.push(value);
                    }
                    Err(flaw) if flaw.unknown.as_ref().is_some_and(is_constant) => later.push((name, formula)),
                    Err(flaw) => return Err(scene.error(&path, flaw.message, flaw.help)),
                }
            }
            if later.len() == before {
                let (name, message) = (later[0].0, "these constants need each other's values");
                return Err(scene.error(&format!("constants.{name}"), message, "give one of them as a number"));
            }
            waiting = later;
        }
        Ok(scope)
    }

    fn parse(&self, formula: &Formula, free: &[&str]) -> std::result::Result<Expression, Flaw> {
        let text = match formula {
            Formula::Number(x) => return Ok(Expression { code: vec![Op::Number(*x)] }),
            Formula::Text(text) => text,
        };
        let names: Vec<&str> = free.iter().copied().chain(self.names.iter().map(String::as_str)).collect();
        let mut expression = Expression::parse(text, &names)?;
        for op in &mut expression.code {
            if let Op::Name(i) = *op
                && i >= free.len()
            {
                *op = Op::Number(self.values[i - free.len()]);
            }
        }
        Ok(expression)
    }

    /// Reads a formula that may use `free` names besides the constants; `path` is where it stands in the scene.
    ///
    /// # Errors
    /// What is wrong with it, with place and remedy.
    pub fn compile(&self, scene: &Scene, path: &str, formula: &Formula, free: &[&str]) -> Result<Expression> {
        self.parse(formula, free).map_err(|flaw| scene.error(path, flaw.message, flaw.help))
    }

    /// The value of a formula of constants alone.
    ///
    /// # Errors
    /// As [`Scope::compile`]; a value that is not finite.
    pub fn number(&self, scene: &Scene, path: &str, formula: &Formula) -> Result<f64> {
        let expression = self.compile(scene, path, formula, &[])?;
        self.finite(scene, path, &expression)
    }

    /// The values of three formulas of constants alone.
    ///
    /// # Errors
    /// As [`Scope::number`].
    pub fn vector(&self, scene: &Scene, path: &str, formulas: &[Formula; 3]) -> Result<glam::DVec3> {
        let mut all = [0.0; 3];
        for (a, f) in formulas.iter().enumerate() {
            all[a] = self.number(scene, &format!("{path}.{a}"), f)?;
        }
        Ok(all.into())
    }

    fn finite(&self, scene: &Scene, path: &str, expression: &Expression) -> Result<f64> {
        let value = expression.eval(&[]);
        if value.is_finite() {
            return Ok(value);
        }
        Err(scene.error(path, format!("`{path}` comes out as {value}"), "make it a finite number"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> f64 {
        Expression::parse(text, &["x", "a-b"]).unwrap_or_else(|f| panic!("{}", f.message)).eval(&[3.0, 0.5])
    }

    #[test]
    fn formulas_mean_what_they_mean_on_paper() {
        assert_eq!(value("1 + 2 * 3 ^ 2 / 4 - 5"), 0.5);
        assert_eq!(value("-x^2"), -9.0);
        assert_eq!(value("2^3^2"), 512.0);
        assert_eq!(value("2^-1"), 0.5);
        assert_eq!(value("8 - 3 - 2"), 3.0);
        assert_eq!(value("-(x - 1) * +2"), -4.0);
        assert_eq!(value("1.5e-3 * 2E3 + .5"), 3.5);
        assert_eq!(value("max(x, 4) + min(x, 4) + mod(-1, 4) + {a-b}"), 10.5);
        assert_eq!(value("if(x - 3, 1, if(x - 2, 2, 3))"), 2.0);
        assert!((value("sin(x)^2 + cos(x)^2 + atan2(1, 1)") - 1.0 - PI / 4.0).abs() < 1e-15);
        assert_eq!(value("sign(-2) + abs(-2) + log(100) + ln(exp(1)) + cbrt(27)"), 7.0);
    }

    #[test]
    fn wrong_formulas_are_refused_with_column_and_remedy() {
        let flaw = |text: &str| Expression::parse(text, &["height", "x"]).unwrap_err();
        for text in ["", "1 +", "(1", "1 2", "sin(1, 2)", "min(1)", "1..2", "{x", "*2", "2 $ 3", "x)"] {
            assert!(flaw(text).message.contains("column"), "{text}");
        }
        assert!(flaw("2 * heigth").help.contains("`height`"));
        assert!(flaw("sinn(x)").help.contains("`sin`"));
        let deep = "(".repeat(10_000);
        assert!(flaw(&deep).message.contains("nested too deep"));
    }
}
