//! What an option is, said once: name, meaning, default, range, and what it goes with. Each door (the command line, Rust,
//! Python, the manifest of a plan) reads that from one table.
//!
//! A struct of options derives [`Options`]. The derive holds no logic: it makes a constant [`OptionTable`] of the fields and a
//! visitor of their values, and all else here is ordinary code over these two.
//!
//! ```
//! use terrane_options::{Options, OptionRange, OptionRule, check, fill};
//!
//! /// Shade the ground.
//! #[derive(Clone, Debug, PartialEq, Options)]
//! #[options(rules = RULES)]
//! struct ShadeOptions {
//!     /// Direction of the light, in degrees clockwise from north
//!     #[option(value = "DEG", default_text = "315")]
//!     azimuth: Option<f64>,
//!     /// Height of the light above the horizon, in degrees
//!     #[option(value = "DEG", default = 45.0, range = OptionRange::new(1.0, 90.0))]
//!     altitude: f64,
//!     /// Light from four directions
//!     multidirectional: bool,
//! }
//!
//! const RULES: &[OptionRule] = &[OptionRule::NotWith("azimuth", &["multidirectional"])];
//!
//! let given = serde_json::json!({ "azimuth": 90, "multidirectional": true });
//! let options: ShadeOptions = fill(given.as_object().unwrap()).unwrap();
//! assert_eq!((options.azimuth, options.altitude), (Some(90.0), 45.0));
//! let error = check(&options).unwrap_err();
//! assert!(error.to_string().starts_with("‹azimuth› cannot be used with ‹multidirectional›"));
//! ```
//!
//! `#[options(rules = ..)]` says which options go together; a rule that names none fails to compile.
//! `#[options(setters = own)]` makes a trait of a setter for each field, `ShadeSetters` of these, which the job
//! `terrane_engine::operation::Job` of the options has; with `setters = group`, the jobs of all structs have it that have
//! the group.
//!
//! # Attributes of fields
//!
//! | `#[option(..)]` | says |
//! |---|---|
//! | `value = "DEG"` | what stands for the value in help |
//! | `default = 45.0`, `default_text = "all cores"` | the default, where it is not that of the type; how it is told where that depends on the machine or the data |
//! | `bare = "auto"` | the value where the option is named without one |
//! | `range = OptionRange::POSITIVE` | least and largest value |
//! | `name = "type"`, `alias = "dtype"`, `short = 'f'` | the name where it cannot be that of the field, others, and a letter |
//! | `with = PathName` | the [`OptionCodec`] of the value, where it is not [`PlainCodec`] |
//! | `stands_for = "max_error"` | an option of another struct in whose place it is: who gives that one is told of this |
//! | `heading = "Output"` | the section of help; `#[options(heading = ..)]` is for all fields of a struct |
//! | `off = ".."` | of a flag that is on: what turning it off does |
//! | `role = Reads` | what the value is to the engine, see [`OptionRole`] |
//! | `positional` | a name before that of the output on the command line, and an argument without a keyword in Python |
//! | `flatten` | a group: the fields of that struct are as if they were of this one |

// The derives name this crate.
extern crate self as terrane_options;

pub mod as_map;
mod codec;
mod fill;
mod rules;
mod table;
mod visit;

pub use codec::{
    AnyValue, Choice, CodecValue, OptionCodec, PlainCodec, SetValue, Settable, read_text,
};
pub use fill::{changed, fill, noted, set_texts, settled, texts_of, to_map};
pub use rules::{assert_rules, check, check_given, check_planned};
pub use serde_json::Value as Json;
pub use table::{
    ChoiceName, OptionArity, OptionEntry, OptionField, OptionKind, OptionRange, OptionRole,
    OptionRule, OptionTable,
};
pub use terrane_derive::{Choice, Options};
pub use visit::{Options, Visit, VisitMut};
