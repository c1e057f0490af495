//! Options declared once: name, meaning, default, range, and valid combinations. Each front end (the command line, Rust,
//! Python, the manifest of a plan) reads them from one table.
//!
//! A struct of options derives [`Options`]. The derive contains no logic: it makes a constant [`OptionTable`] of the fields
//! and a visitor of their values; everything else is ordinary code on these two.
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
//! `#[options(rules = ..)]` lists rules on combinations of options; a rule with an unknown option fails to compile.
//! `#[options(setters = own)]` makes a trait with a setter for each field, here `ShadeSetters`, for the job
//! `terrane_engine::operation::Job` of the options; with `setters = group`, it is for the jobs of all structs that contain
//! the group.
//!
//! # Attributes of fields
//!
//! | `#[option(..)]` | meaning |
//! |---|---|
//! | `value = "DEG"` | placeholder of the value in help |
//! | `default = 45.0`, `default_text = "all cores"` | the default, if it is not that of the type; its description, if it depends on the machine or the data |
//! | `bare = "auto"` | the value if the option is given without one |
//! | `range = OptionRange::POSITIVE` | minimum and maximum |
//! | `name = "type"`, `alias = "dtype"`, `short = 'f'` | name, if it cannot be that of the field; alias; short name |
//! | `with = PathName` | the [`OptionCodec`] of the value, if it is not [`PlainCodec`] |
//! | `stands_for = "max_error"` | an equivalent option of another struct, for hints to users who pass that one |
//! | `heading = "Output"` | the section of help; `#[options(heading = ..)]` applies to all fields of a struct |
//! | `off = ".."` | effect of turning off a flag that is on by default |
//! | `role = Reads` | role of the value in the engine, see [`OptionRole`] |
//! | `positional` | a positional argument before the output on the command line, and in Python |
//! | `flatten` | a group: its fields are flattened into this struct |

// The derives name this crate.
extern crate self as terrane_options;

pub mod as_map;
mod codec;
mod rules;
mod table;
mod values;
mod visit;

pub use codec::{
    AnyValue, Choice, CodecValue, OptionCodec, PlainCodec, SetValue, Settable, read_text,
};
pub use rules::{assert_rules, check, check_given, check_planned};
pub use serde_json::Value as Json;
pub use table::{
    ChoiceName, OptionArity, OptionEntry, OptionField, OptionKind, OptionRange, OptionRole,
    OptionRule, OptionTable,
};
pub use terrane_derive::{Choice, Options};
pub use values::{changed, fill, noted, set_texts, settled, texts_of, to_map};
pub use visit::{Options, Visit, VisitMut};
