//! The returns of one pulse.

use super::flight::LaserPulse;
use super::landscape::{LandscapeWindow, PulseTarget};
use super::random::PulseRandom;
use super::survey::LidarSurvey;
use terrane_base::geom::Point;

/// Class of the ground.
pub const GROUND: u8 = 2;
/// Class of roofs.
pub const BUILDING: u8 = 6;
/// Class of returns from below the ground.
pub const LOW_NOISE: u8 = 7;
/// Class of returns from the air.
pub const HIGH_NOISE: u8 = 18;

/// A return of a pulse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SimulatedReturn {
    /// Steps of [`LidarSurvey::scale`] east and north of the south-west corner, and up from zero.
    pub point: Point,
    /// Seconds, growing along a line and from line to line.
    pub time: f64,
    /// Intensity, by the class of the target.
    pub intensity: u16,
    /// Number of the flight line, from 1.
    pub source: u16,
    /// Angle of the beam in steps of 0.006 degrees, positive to the east.
    pub angle: i16,
    /// Return number, from 1, the highest first.
    pub number: u8,
    /// Number of returns of the pulse.
    pub of: u8,
    /// ASPRS class.
    pub class: u8,
    /// True for a point that is known to be wrong.
    pub withheld: bool,
    /// True beyond the middle of the overlap with the neighbouring line.
    pub overlap: bool,
    /// True when the scanner moved to the east.
    pub eastward: bool,
    /// True for the ends of a scan line.
    pub edge: bool,
}

/// Maximum number of returns of a pulse.
pub(super) const MAX_RETURNS: u32 = 4;

/// Maximum horizontal distance in metres of a return from its pulse's position on the ground: trees are at
/// most 23 m high, and the tangent of the beam's angle is at most 0.2.
pub(super) const LEAN: f64 = 5.0;

/// A return above the ground, and its class.
#[derive(Clone, Copy)]
struct PulseReturn {
    /// Metres above the ground.
    above: f64,
    class: u8,
}

const ON_GROUND: PulseReturn = PulseReturn { above: 0.0, class: GROUND };

/// Returns of a pulse, from high to low.
struct PulseReturns {
    hits: [PulseReturn; MAX_RETURNS as usize],
    count: usize,
}

impl PulseReturns {
    fn single(hit: PulseReturn) -> Self {
        Self { hits: [hit; MAX_RETURNS as usize], count: 1 }
    }

    fn push(&mut self, hit: PulseReturn) {
        self.hits[self.count] = hit;
        self.count += 1;
    }
}

/// Adds the returns of a pulse to `echoes`.
#[inline(always)]
pub(super) fn echoes(
    survey: &LidarSurvey,
    land: &LandscapeWindow,
    shot: &LaserPulse,
    echoes: &mut Vec<SimulatedReturn>,
) {
    let steps = [shot.x, shot.y].map(|place| (place * land.by_metre) as i32);
    let [x, y] = steps.map(|step| f64::from(step) * survey.scale);
    let Some(place) = land.at(x, y) else { return };
    let mut dice = shot.dice;
    let ground = land.ground(x, y);
    let template = template(shot);
    if shot.luck < survey.outliers {
        echoes.push(stray(land, steps, ground, template, &mut dice));
        return;
    }
    let hits = match place {
        PulseTarget::Bare => PulseReturns::single(ON_GROUND),
        PulseTarget::Roof(building) => PulseReturns::single(PulseReturn {
            above: building.height(x, y) - ground,
            class: BUILDING,
        }),
        PulseTarget::Crown(height) => through_crown(height, &mut dice),
        PulseTarget::Undergrowth => through_undergrowth(&mut dice),
    };
    for (hit, number) in hits.hits[..hits.count].iter().zip(1..) {
        let point = place_of(land, steps, [ground, shot.tangent], *hit, &mut dice);
        let intensity = intensity(hit.class, &mut dice);
        let of = hits.count as u8;
        echoes.push(SimulatedReturn { point, intensity, number, of, class: hit.class, ..template });
    }
}

/// Attributes shared by all returns of a pulse.
fn template(shot: &LaserPulse) -> SimulatedReturn {
    SimulatedReturn {
        time: shot.time,
        source: shot.source,
        angle: (angle(shot.tangent) * (1.0 / 0.006)) as i16,
        overlap: shot.overlap,
        eastward: shot.eastward,
        edge: shot.edge,
        ..SimulatedReturn::default()
    }
}

/// Degrees of an angle by its tangent, which is at most about 0.2: two terms of the series.
fn angle(tangent: f64) -> f64 {
    tangent * (1.0 - tangent * tangent * (1.0 / 3.0)) * 57.295_779_513_082_32
}

/// A point with range noise along the beam: higher hits lie nearer to the aircraft.
fn place_of(
    land: &LandscapeWindow,
    [x, y]: [i32; 2],
    [ground, tangent]: [f64; 2],
    hit: PulseReturn,
    dice: &mut PulseRandom,
) -> Point {
    let shift = (hit.above * tangent * land.by_metre) as i32;
    let nearer = if hit.class == GROUND || hit.class == BUILDING { x } else { x - shift };
    let x = if (0..land.columns).contains(&nearer) { nearer } else { x };
    Point::new(x, y, steps_of(land, ground + hit.above + land.noise * dice.bell()))
}

/// Height in whole steps, rounded to the nearest. Lifted above zero, a plain conversion rounds down.
fn steps_of(land: &LandscapeWindow, z: f64) -> i32 {
    const LIFT: i64 = 1 << 31;
    ((z * land.by_metre + (LIFT as f64 + 0.5)) as i64 - LIFT) as i32
}

fn intensity(class: u8, dice: &mut PulseRandom) -> u16 {
    let base = match class {
        GROUND => 400,
        BUILDING => 700,
        _ => 150,
    };
    base + u16::from(dice.byte())
}

/// An outlier: from below the ground, from the air, or flagged as withheld.
fn stray(
    land: &LandscapeWindow,
    at: [i32; 2],
    ground: f64,
    template: SimulatedReturn,
    dice: &mut PulseRandom,
) -> SimulatedReturn {
    let [kind, size, strength, _] = dice.four();
    let (class, above, withheld) = match kind {
        k if k < 0.4 => (LOW_NOISE, -(1.0 + 29.0 * size * size), false),
        k if k < 0.7 => (HIGH_NOISE, 40.0 + 260.0 * size, false),
        _ => (GROUND, 10.0 * (size - 0.5), true),
    };
    let point = Point::new(at[0], at[1], steps_of(land, ground + above));
    let intensity = (100.0 * strength) as u16;
    SimulatedReturn { point, intensity, number: 1, of: 1, class, withheld, ..template }
}

/// Class of vegetation of a height.
fn vegetation(above: f64) -> PulseReturn {
    let class = match above {
        h if h < 0.5 => 3,
        h if h < 2.0 => 4,
        _ => 5,
    };
    PulseReturn { above, class }
}

/// A crown gives one to four returns; the last one is mostly from the ground.
fn through_crown(height: f64, dice: &mut PulseRandom) -> PulseReturns {
    let [count, through, top, depth] = dice.four();
    let first = vegetation(height * (1.0 - 0.1 * top));
    let more = match count {
        c if c < 0.3 => 0,
        c if c < 0.65 => 1,
        c if c < 0.9 => 2,
        _ => 3,
    };
    if more == 0 {
        return PulseReturns::single(if through < 0.3 { ON_GROUND } else { first });
    }
    let mut hits = PulseReturns::single(first);
    for k in 1..more {
        let share = (f64::from(more - k) + 0.6 * (depth - 0.5)) / f64::from(more + 1);
        hits.push(vegetation(first.above * share));
    }
    hits.push(if through < 0.75 { ON_GROUND } else { vegetation(first.above * 0.2 * depth) });
    hits
}

/// Scattered shrubs between crowns.
fn through_undergrowth(dice: &mut PulseRandom) -> PulseReturns {
    let [is_there, height, through, _] = dice.four();
    if is_there >= 0.25 {
        return PulseReturns::single(ON_GROUND);
    }
    let shrub = vegetation(0.15 + 1.6 * height);
    let mut hits = PulseReturns::single(shrub);
    if shrub.above > 0.8 && through < 0.5 {
        hits.push(ON_GROUND);
    }
    hits
}
