//! What kernels leave open: the slots that a head may name, and what may fill each.

/// A choice. A kernel is made once for each way to fill its slots.
pub(crate) struct Slot {
    pub(crate) name: &'static str,
    pub(crate) values: &'static [Value],
}

/// One way to fill a slot.
pub(crate) struct Value {
    pub(crate) name: &'static str,
    /// What stands in a head for `{slot.face}`: shared files, in this order.
    pub(crate) faces: &'static [(&'static str, &'static [&'static str])],
}

/// All slots. `src/variant.rs` says which value a method takes.
pub(crate) const SLOTS: &[Slot] = &[
    Slot {
        name: "intersector",
        values: &[
            Value {
                name: "moller_trumbore",
                faces: &[
                    (
                        "test",
                        &["answers_extremes", "record", "textbook", "moller_trumbore"],
                    ),
                    ("bind", &[]),
                    ("open", &[]),
                    ("closest", &["textbook_closest"]),
                    ("any", &["textbook_any", "store_occluded"]),
                    ("way", &["shadow_from_triangle"]),
                ],
            },
            Value {
                name: "woop",
                faces: &[
                    (
                        "test",
                        &["answers_extremes", "textbook", "point", "points", "woop"],
                    ),
                    ("bind", &["bind_corners"]),
                    ("open", &[]),
                    ("closest", &["textbook_closest"]),
                    ("any", &["textbook_any", "store_occluded"]),
                    ("way", &["shadow_from_triangle"]),
                ],
            },
            Value {
                name: "watertight",
                faces: &[
                    (
                        "test",
                        &[
                            "leaves_extremes",
                            "record",
                            "sheared",
                            "extremes",
                            "own_box",
                            "watertight",
                        ],
                    ),
                    ("bind", &[]),
                    ("open", &[]),
                    ("closest", &["watertight_closest"]),
                    ("any", &["watertight_any", "store_occluded"]),
                    ("way", &["shadow_from_leaf"]),
                    ("packets", &[]),
                ],
            },
            Value {
                name: "exact",
                faces: &[
                    (
                        "test",
                        &[
                            "record",
                            "sheared",
                            "extremes",
                            "own_box",
                            "view",
                            "leaves_extremes",
                            "filter",
                            "notes",
                            "record_candidate",
                        ],
                    ),
                    ("bind", &[]),
                    ("open", &["bind_occluded"]),
                    ("closest", &["sure_closest"]),
                    ("any", &["sure_any"]),
                    ("way", &["shadow_from_leaf"]),
                    (
                        "settle",
                        &[
                            "record",
                            "sheared",
                            "extremes",
                            "own_box",
                            "view",
                            "leaves_extremes",
                            "filter",
                            "notes",
                            "whole",
                            "point",
                            "points",
                            "line",
                            "fixed",
                            "determinants",
                            "decide",
                        ],
                    ),
                    (
                        "finish",
                        &[
                            "record",
                            "sheared",
                            "extremes",
                            "own_box",
                            "view",
                            "leaves_extremes",
                            "filter",
                            "notes",
                            "whole",
                            "point",
                            "points",
                            "line",
                            "fixed",
                            "determinants",
                            "alone",
                        ],
                    ),
                ],
            },
        ],
    },
    Slot {
        name: "record",
        values: &[
            Value {
                name: "corners",
                faces: &[("write", &["record_corners"])],
            },
            Value {
                name: "rows",
                faces: &[("write", &["record_woop"])],
            },
        ],
    },
    Slot {
        name: "layout",
        values: &[
            Value {
                name: "bvh2",
                faces: &[("nodes", &["nodes_bvh2"]), ("link", &["link_bvh2"])],
            },
            Value {
                name: "fast",
                faces: &[("nodes", &["nodes_fast"]), ("link", &["link_fast"])],
            },
        ],
    },
    // Kernels that only layout `fast` has.
    Slot {
        name: "treelets",
        values: &[Value {
            name: "fast",
            faces: &[
                ("adopt", &[]),
                ("nodes", &["nodes_fast"]),
                ("refit", &["treelet", "area"]),
            ],
        }],
    },
];

impl Value {
    /// The shared files of a face.
    pub(crate) fn face(&self, name: &str) -> Option<&'static [&'static str]> {
        let found = self.faces.iter().find(|(face, _)| *face == name);
        found.map(|(_, parts)| *parts)
    }
}
