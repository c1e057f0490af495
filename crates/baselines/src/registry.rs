//! The methods by name.

use crate::method::BaselineMethod;
use crate::{collapse, drop, greedy, kdtree, rtin, vip};

/// All methods. A new one is a file and a line here.
pub const METHODS: &[BaselineMethod] = &[
    greedy::GREEDY_1,
    greedy::GREEDY_2,
    greedy::GREEDY_3,
    greedy::GREEDY_4,
    vip::VIP,
    rtin::RTIN,
    kdtree::KDTREE,
    drop::DROP,
    collapse::COLLAPSE,
];
