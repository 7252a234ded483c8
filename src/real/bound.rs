//! The bound type: sound intervals of value and gradient over a box.
