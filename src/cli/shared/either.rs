//! Options of a verb that reads grids as well as clouds: those of two operations, of which the inputs choose one.

use clap::{ArgMatches, Command};
use terrane_options::{Field, Options, Role, to_map};

use crate::cli::shared::tabled::{argument, given, set};
use crate::error::{Error, Result};
use crate::files::path_of;

/// Options of an operation on grids, those of one on clouds, and the names of those that were given; of a plan those that
/// say something of the result alone. What both have is said once.
#[derive(Clone, Debug)]
pub(crate) struct Either<G, C, const PLANNED: bool = false> {
    grid: G,
    cloud: C,
    given: Vec<&'static str>,
}

/// The options of both, each with what it is of clouds where it is of these, too.
fn fields<G: Options, C: Options, const PLANNED: bool>()
-> impl Iterator<Item = (&'static Field, Option<&'static Field>)> {
    let of_grids = G::TABLE.fields().into_iter().map(|own| (own, C::TABLE.find(own.name)));
    let of_clouds = C::TABLE.fields().into_iter().filter(|own| G::TABLE.find(own.name).is_none());
    let all = of_grids.chain(of_clouds.map(|own| (own, None)));
    all.filter(|(field, _)| !(PLANNED && field.role == Role::Run))
}

impl<G: Options, C: Options, const PLANNED: bool> clap::Args for Either<G, C, PLANNED> {
    fn augment_args(command: Command) -> Command {
        let mut defaults = to_map(&C::default());
        defaults.extend(to_map(&G::default()));
        fields::<G, C, PLANNED>().fold(command, |command, (field, of_cloud)| {
            let other = of_cloud.map(|own| own.about).filter(|about| *about != field.about);
            command.arg(argument(field, &defaults[field.name], other))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl<G: Options, C: Options, const PLANNED: bool> clap::FromArgMatches for Either<G, C, PLANNED> {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let mut all = Self { grid: G::default(), cloud: C::default(), given: Vec::new() };
        for (field, _) in fields::<G, C, PLANNED>() {
            let texts = given(field, matches);
            if texts.is_empty() {
                continue;
            }
            all.given.push(field.name);
            if let Some(field) = G::TABLE.find(field.name) {
                set(&mut all.grid, field, &texts)?;
            }
            if let Some(field) = C::TABLE.find(field.name) {
                set(&mut all.cloud, field, &texts)?;
            }
        }
        Ok(all)
    }

    fn update_from_arg_matches(
        &mut self,
        matches: &ArgMatches,
    ) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl<G: Options + Clone, C: Options + Clone, const PLANNED: bool> Either<G, C, PLANNED> {
    /// The names of options that were given.
    pub(crate) fn given(&self) -> &[&'static str] {
        &self.given
    }

    /// The options for a grid.
    ///
    /// # Errors
    /// Usage: an option of clouds was given.
    pub(crate) fn of_grid(&self, input: &str) -> Result<G> {
        let odd = self.given.iter().find(|name| G::TABLE.find(name).is_none());
        match odd.and_then(|name| C::TABLE.find(name)) {
            None => Ok(self.grid.clone()),
            Some(field) => Err(refusal(field, input, "point clouds, and this is none")),
        }
    }

    /// The options for a cloud.
    ///
    /// # Errors
    /// Usage: an option of grids was given.
    pub(crate) fn of_cloud(&self, input: &str) -> Result<C> {
        let odd = self.given.iter().find(|name| C::TABLE.find(name).is_none());
        match odd.and_then(|name| G::TABLE.find(name)) {
            None => Ok(self.cloud.clone()),
            Some(field) => Err(refusal(field, input, "grids, and this is a point cloud")),
        }
    }
}

/// The error of an option of other inputs.
fn refusal(field: &Field, input: &str, whose: &str) -> Error {
    let off = if field.off.is_some() { "=false" } else { "" };
    let option = format!("‹{}{off}›", field.name);
    Error::usage(format!("{option} is for {whose}"))
        .in_file(&path_of(input))
        .remedy(format!("leave {option} out"))
}
