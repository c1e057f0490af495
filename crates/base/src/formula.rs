//! Expressions over named numbers: formulas (`intensity / 256`) and conditions
//! (`intensity > 100 and point_source_id in (7, 9)`), read by one parser.
//!
//! ```text
//! condition   = conjunction { ("or" | "||") conjunction }
//! conjunction = negation { ("and" | "&&") negation }
//! negation    = ("not" | "!") negation | comparison
//! comparison  = sum [ ("=" | "==" | "!=" | "<>" | "<" | "<=" | ">" | ">=") sum
//!                   | ["not"] "in" "(" sum { "," sum } ")" ]
//! sum         = product { ("+" | "-") product }
//! product     = factor { ("*" | "/") factor }
//! factor      = "-" factor | "(" condition ")" | number | name | '"' name '"'
//! ```

use std::convert::Infallible;

/// Maximum nesting of parentheses, signs and negations.
const DEEPEST: u32 = 64;
/// Maximum number of steps of an expression.
const MAX_STEPS: usize = 4096;
/// Value of a true condition.
const TRUE: f64 = 1.0;
const FALSE: f64 = 0.0;
/// Reserved words; names equal to them need quotes.
const WORDS: [&str; 4] = ["and", "or", "not", "in"];

/// An expression as steps of a stack machine; `Name` is the type of resolved names.
#[derive(Clone, Debug, PartialEq)]
pub struct Formula<Name>(Vec<FormulaStep<Name>>);

#[derive(Clone, Debug, PartialEq)]
enum FormulaStep<Name> {
    Number(f64),
    Value(Name),
    Negate,
    Add,
    Subtract,
    Multiply,
    Divide,
    Compare(ComparisonOperator),
    /// True if one of this number of values equals the value before them.
    In(usize),
    And,
    Or,
    Not,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum ComparisonOperator {
    Equal,
    Unequal,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
}

/// Comparison operators by their signs; longer signs precede their prefixes.
const COMPARISONS: [(&str, ComparisonOperator); 8] = [
    ("==", ComparisonOperator::Equal),
    ("!=", ComparisonOperator::Unequal),
    ("<>", ComparisonOperator::Unequal),
    ("<=", ComparisonOperator::LessOrEqual),
    (">=", ComparisonOperator::GreaterOrEqual),
    ("=", ComparisonOperator::Equal),
    ("<", ComparisonOperator::Less),
    (">", ComparisonOperator::Greater),
];

/// Type of the result of a subexpression.
#[derive(Clone, Copy, Debug, PartialEq)]
enum FormulaType {
    Number,
    Truth,
}

impl Formula<String> {
    /// Parses a formula with a numeric result.
    ///
    /// # Errors
    /// Invalid text, or a condition.
    pub fn number(text: &str) -> Result<Self, String> {
        match parse(text)? {
            (formula, FormulaType::Number) => Ok(formula),
            (_, FormulaType::Truth) => Err(format!("{text:?} is a condition, not a number")),
        }
    }

    /// Parses a condition.
    ///
    /// # Errors
    /// Invalid text, or a number.
    pub fn condition(text: &str) -> Result<Self, String> {
        match parse(text)? {
            (formula, FormulaType::Truth) => Ok(formula),
            (_, FormulaType::Number) => Err(format!(
                "{text:?} is not a condition; write a comparison such as intensity > 100"
            )),
        }
    }

    /// The same expression with `find` applied to each name.
    ///
    /// # Errors
    /// Errors of `find`.
    pub fn resolve<Name, E>(
        &self,
        mut find: impl FnMut(&str) -> Result<Name, E>,
    ) -> Result<Formula<Name>, E> {
        self.0.iter().map(|step| step.resolve(&mut find)).collect::<Result<_, E>>().map(Formula)
    }
}

impl FormulaStep<String> {
    fn resolve<Name, E>(
        &self,
        find: impl FnOnce(&str) -> Result<Name, E>,
    ) -> Result<FormulaStep<Name>, E> {
        Ok(match self {
            Self::Number(number) => FormulaStep::Number(*number),
            Self::Value(name) => FormulaStep::Value(find(name)?),
            Self::Negate => FormulaStep::Negate,
            Self::Add => FormulaStep::Add,
            Self::Subtract => FormulaStep::Subtract,
            Self::Multiply => FormulaStep::Multiply,
            Self::Divide => FormulaStep::Divide,
            Self::Compare(how) => FormulaStep::Compare(*how),
            Self::In(count) => FormulaStep::In(*count),
            Self::And => FormulaStep::And,
            Self::Or => FormulaStep::Or,
            Self::Not => FormulaStep::Not,
        })
    }
}

impl<Name> Formula<Name> {
    /// Evaluates the formula in double precision.
    ///
    /// # Errors
    /// Errors of `value`, division by zero, numeric overflow.
    pub fn compute(
        &self,
        stack: &mut Vec<f64>,
        value: impl Fn(&Name) -> Result<f64, String>,
    ) -> Result<f64, String> {
        self.run(stack, value, |found| found.map_err(str::to_owned))
    }

    /// Whether the condition is true. As in SQL, results of missing values (NaN) and of divisions by zero are neither
    /// true nor false.
    pub fn holds(&self, stack: &mut Vec<f64>, value: impl Fn(&Name) -> f64) -> bool {
        let Ok(result) = self.run::<Infallible>(
            stack,
            |name| Ok(value(name)),
            |result| Ok(result.unwrap_or(f64::NAN)),
        );
        result == TRUE
    }

    fn run<E>(
        &self,
        stack: &mut Vec<f64>,
        value: impl Fn(&Name) -> Result<f64, E>,
        settle: impl Fn(Result<f64, &'static str>) -> Result<f64, E>,
    ) -> Result<f64, E> {
        stack.clear();
        for step in &self.0 {
            let result = match step {
                FormulaStep::Number(number) => *number,
                FormulaStep::Value(name) => value(name)?,
                other => settle(other.apply(stack))?,
            };
            stack.push(result);
        }
        Ok(pop(stack))
    }
}

impl<Name> FormulaStep<Name> {
    /// Replaces the operands of an operator with its result.
    fn apply(&self, stack: &mut Vec<f64>) -> Result<f64, &'static str> {
        let mut last = || pop(stack);
        let result = match self {
            Self::Negate => -last(),
            Self::Add => last() + last(),
            Self::Multiply => last() * last(),
            // The operand on the right comes off the stack first.
            Self::Subtract => -last() + last(),
            Self::Divide => match (last(), last()) {
                (0.0, _) => return Err("division by zero"),
                (by, number) => number / by,
            },
            Self::Compare(how) => {
                let (right, left) = (last(), last());
                return Ok(truth(how.holds(left, right), left.is_nan() || right.is_nan()));
            }
            Self::In(count) => {
                let all: Vec<f64> = (0..*count).map(|_| last()).collect();
                let number = last();
                let is_unknown = number.is_nan() || all.iter().any(|value| value.is_nan());
                let is_in = all.contains(&number);
                return Ok(truth(is_in, is_unknown && !is_in));
            }
            // The conjunction is the minimum of two truth values; NaN lies between false and true.
            Self::And => return Ok(and(last(), last())),
            Self::Or => return Ok(TRUE - and(TRUE - last(), TRUE - last())),
            Self::Not => return Ok(TRUE - last()),
            Self::Number(_) | Self::Value(_) => f64::NAN,
        };
        if result.is_finite() { Ok(result) } else { Err("numeric overflow") }
    }
}

impl ComparisonOperator {
    fn holds(self, left: f64, right: f64) -> bool {
        match self {
            Self::Equal => left == right,
            Self::Unequal => left != right,
            Self::Less => left < right,
            Self::LessOrEqual => left <= right,
            Self::Greater => left > right,
            Self::GreaterOrEqual => left >= right,
        }
    }
}

fn truth(is_true: bool, is_unknown: bool) -> f64 {
    match (is_unknown, is_true) {
        (true, _) => f64::NAN,
        (false, true) => TRUE,
        (false, false) => FALSE,
    }
}

/// Conjunction of two truth values.
fn and(a: f64, b: f64) -> f64 {
    if a == FALSE || b == FALSE { FALSE } else { a * b }
}

/// Pops the last value; a parsed expression never underflows.
fn pop(stack: &mut Vec<f64>) -> f64 {
    stack.pop().unwrap_or(f64::NAN)
}

fn parse(text: &str) -> Result<(Formula<String>, FormulaType), String> {
    let mut parser = FormulaParser { rest: text, steps: Vec::new(), depth: 0 };
    let kind = parser.condition()?;
    match parser.peek() {
        None => Ok((Formula(parser.steps), kind)),
        Some(odd) => Err(format!("unexpected {odd:?} in the formula {text:?}")),
    }
}

/// Parses text from left to right.
struct FormulaParser<'a> {
    rest: &'a str,
    steps: Vec<FormulaStep<String>>,
    depth: u32,
}

impl FormulaParser<'_> {
    /// The next character that is not white space.
    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    /// Consumes a sign if it is next.
    fn sign(&mut self, sign: &str) -> bool {
        self.peek();
        let rest = self.rest.strip_prefix(sign);
        self.rest = rest.unwrap_or(self.rest);
        rest.is_some()
    }

    /// Consumes a word if it is next; letter case is ignored.
    fn word(&mut self, word: &str) -> bool {
        self.peek();
        let (name, rest) = split(self.rest, is_of_name);
        let is_it = name.eq_ignore_ascii_case(word);
        if is_it {
            self.rest = rest;
        }
        is_it
    }

    /// Appends a step.
    fn push(
        &mut self,
        step: FormulaStep<String>,
        kind: FormulaType,
    ) -> Result<FormulaType, String> {
        if self.steps.len() == MAX_STEPS {
            return Err(format!("the formula has more than {MAX_STEPS} steps"));
        }
        self.steps.push(step);
        Ok(kind)
    }

    fn condition(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.conjunction()?;
        while self.word("or") || self.sign("||") {
            is(FormulaType::Truth, kind)?;
            is(FormulaType::Truth, self.conjunction()?)?;
            kind = self.push(FormulaStep::Or, FormulaType::Truth)?;
        }
        Ok(kind)
    }

    fn conjunction(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.negation()?;
        while self.word("and") || self.sign("&&") {
            is(FormulaType::Truth, kind)?;
            is(FormulaType::Truth, self.negation()?)?;
            kind = self.push(FormulaStep::And, FormulaType::Truth)?;
        }
        Ok(kind)
    }

    fn negation(&mut self) -> Result<FormulaType, String> {
        if !self.word("not") && !self.sign("!") {
            return self.comparison();
        }
        self.deeper(|parser| is(FormulaType::Truth, parser.negation()?))?;
        self.push(FormulaStep::Not, FormulaType::Truth)
    }

    fn comparison(&mut self) -> Result<FormulaType, String> {
        let kind = self.sum()?;
        if let Some(how) = self.compared() {
            is(FormulaType::Number, kind)?;
            is(FormulaType::Number, self.sum()?)?;
            if self.compared().is_some() {
                return Err(
                    "chained comparisons are not supported; write 1 < z and z < 5".to_owned()
                );
            }
            return self.push(FormulaStep::Compare(how), FormulaType::Truth);
        }
        let is_not = self.word("not");
        if !self.word("in") {
            return if is_not { Err("expected in after not".to_owned()) } else { Ok(kind) };
        }
        is(FormulaType::Number, kind)?;
        let count = self.list()?;
        self.push(FormulaStep::In(count), FormulaType::Truth)?;
        if is_not {
            self.push(FormulaStep::Not, FormulaType::Truth)
        } else {
            Ok(FormulaType::Truth)
        }
    }

    /// The comparison operator at this position, if any.
    fn compared(&mut self) -> Option<ComparisonOperator> {
        let (_, how) = COMPARISONS.into_iter().find(|(sign, _)| self.sign(sign))?;
        Some(how)
    }

    /// Parses numbers in parentheses; returns their count.
    fn list(&mut self) -> Result<usize, String> {
        if !self.sign("(") {
            return Err("expected a list in parentheses after in".to_owned());
        }
        let mut count = 0;
        loop {
            is(FormulaType::Number, self.deeper(Self::sum)?)?;
            count += 1;
            match (self.sign(","), self.sign(")")) {
                (true, false) => {}
                (false, true) => return Ok(count),
                _ => return Err("the list after in is not closed".to_owned()),
            }
        }
    }

    fn sum(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.product()?;
        while let Some(sign @ ('+' | '-')) = self.peek() {
            self.rest = &self.rest[1..];
            is(FormulaType::Number, kind)?;
            is(FormulaType::Number, self.product()?)?;
            let step = if sign == '+' { FormulaStep::Add } else { FormulaStep::Subtract };
            kind = self.push(step, FormulaType::Number)?;
        }
        Ok(kind)
    }

    fn product(&mut self) -> Result<FormulaType, String> {
        let mut kind = self.factor()?;
        while let Some(sign @ ('*' | '/')) = self.peek() {
            self.rest = &self.rest[1..];
            is(FormulaType::Number, kind)?;
            is(FormulaType::Number, self.factor()?)?;
            let step = if sign == '*' { FormulaStep::Multiply } else { FormulaStep::Divide };
            kind = self.push(step, FormulaType::Number)?;
        }
        Ok(kind)
    }

    fn deeper<T>(
        &mut self,
        parse: impl FnOnce(&mut Self) -> Result<T, String>,
    ) -> Result<T, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err(format!("the formula is nested more than {DEEPEST} levels deep"));
        }
        let parsed = parse(self);
        self.depth -= 1;
        parsed
    }

    fn factor(&mut self) -> Result<FormulaType, String> {
        match self.peek() {
            Some('-') => {
                self.rest = &self.rest[1..];
                is(FormulaType::Number, self.deeper(Self::factor)?)?;
                self.push(FormulaStep::Negate, FormulaType::Number)
            }
            Some('(') => {
                self.rest = &self.rest[1..];
                let kind = self.deeper(Self::condition)?;
                match self.sign(")") {
                    true => Ok(kind),
                    false => Err("unclosed parenthesis in the formula".to_owned()),
                }
            }
            Some('"') => {
                let quoted = self.rest[1..].split_once('"');
                let (name, rest) = quoted.ok_or("unclosed quotation mark in the formula")?;
                self.rest = rest;
                self.push(FormulaStep::Value(name.to_owned()), FormulaType::Number)
            }
            Some(first) if first.is_ascii_digit() || first == '.' => self.literal(),
            Some(first) if first.is_alphabetic() || first == '_' => {
                let (name, rest) = split(self.rest, is_of_name);
                if WORDS.iter().any(|word| word.eq_ignore_ascii_case(name)) {
                    return Err(format!("unexpected {name} in the formula"));
                }
                self.rest = rest;
                self.push(FormulaStep::Value(name.to_owned()), FormulaType::Number)
            }
            Some(odd) => Err(format!("unexpected {odd:?} in the formula")),
            None => Err("unexpected end of the formula; expected a number or name".to_owned()),
        }
    }

    fn literal(&mut self) -> Result<FormulaType, String> {
        let mut is_exponent = false;
        let (text, rest) = split(self.rest, |c| {
            let is_part = c.is_ascii_alphanumeric() || c == '.' || is_exponent && "+-".contains(c);
            is_exponent = matches!(c, 'e' | 'E');
            is_part
        });
        self.rest = rest;
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        let number = number.ok_or_else(|| format!("{text} is not a number"))?;
        self.push(FormulaStep::Number(number), FormulaType::Number)
    }
}

/// Fails if a subexpression does not have the expected type.
fn is(expected: FormulaType, found: FormulaType) -> Result<FormulaType, String> {
    match (expected, found) {
        (FormulaType::Truth, FormulaType::Number) => {
            Err("operands of and, or and not must be conditions such as intensity > 100".to_owned())
        }
        (FormulaType::Number, FormulaType::Truth) => {
            Err("expected a number, found a condition".to_owned())
        }
        _ => Ok(found),
    }
}

/// Splits text into the prefix of characters that are `is_part`, and the rest.
fn split(text: &str, mut is_part: impl FnMut(char) -> bool) -> (&str, &str) {
    text.split_at(text.find(|c| !is_part(c)).unwrap_or(text.len()))
}

fn is_of_name(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '[' | ']')
}

#[cfg(test)]
mod tests;
