//! Errors of heights that the sample type cannot store, with position and remedy.

use crate::grid::SampleType;
use terrane_base::error::Error;

/// Reason why a height cannot be stored, and its index in the run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum SampleMisfit {
    /// A void without a nodata value.
    Void(usize),
    /// A height beyond the range of the sample type.
    Beyond(usize, f64),
    /// A height between two values of the sample type.
    Between(usize, f64),
    /// A height equal to the nodata value.
    Nodata(usize, f64),
}

const CHOOSE_FOR_VOIDS: &str =
    "pass an unused value in the range of the type as ‹nodata› or ‹out_nodata›";
const CHOOSE_NODATA: &str = "pass another value as ‹out_nodata› (‹nodata› of ‹terrane grid›)";
const CHOOSE_TYPE: &str = "choose a wider type with ‹type›";
const ROUND: &str = "pass ‹round› to store the nearest value, or choose another type with ‹type›";

impl SampleMisfit {
    /// The error, for a run that begins at column `col` of row `row`.
    pub(super) fn error(
        self,
        sample_type: SampleType,
        nodata: Option<f64>,
        col: u32,
        row: u32,
    ) -> Error {
        let name = sample_type.name();
        let (at, message, remedy) = match (self, nodata) {
            (Self::Void(at), Some(value)) => {
                let message =
                    format!("sample is void, but nodata value {value} cannot be stored as {name}");
                (at, message, CHOOSE_FOR_VOIDS)
            }
            (Self::Void(at), None) => {
                (at, "sample is void, but no nodata value is declared".to_owned(), CHOOSE_FOR_VOIDS)
            }
            (Self::Beyond(at, height), _) => {
                (at, format!("height {height} is outside the range of {name}"), CHOOSE_TYPE)
            }
            (Self::Between(at, height), _) => {
                (at, format!("height {height} cannot be stored exactly as {name}"), ROUND)
            }
            (Self::Nodata(at, height), _) => {
                (at, format!("height {height} would be read as nodata"), CHOOSE_NODATA)
            }
        };
        Error::bad_input(message)
            .at(format_args!("column {}, row {row}", u64::from(col) + at as u64))
            .remedy(remedy)
    }
}
