// Boxes of all treelets above those of triangles, in the same dispatch: the workgroup that comes last to a parent goes on
// with it, as in Karras 2012 (Maximizing Parallelism in the Construction of BVHs), section 4, but treelet by treelet.
// What one workgroup leaves to another goes through atomics, which no cache hides, and a barrier of the device's memory.

// The area of each treelet; how many came to each; then eight words for each root.
@group(0) @binding(next) var<storage, read_write> costs: array<atomic<u32>>;

const NO_PARENT: u32 = 0xffffffffu;

// The treelet to go on with.
var<workgroup> next_treelet: u32;

fn cost_at(i: u32) -> f32 { return bitcast<f32>(atomicLoad(&costs[i])); }
fn keep_cost(i: u32, cost: f32) { atomicStore(&costs[i], bitcast<u32>(cost)); }
fn put_count(i: u32, x: f32) { atomicStore(&counts[i], bitcast<u32>(x)); }

// Where a root's words begin, by its row: roots' rows follow each other from the first treelet's on.
fn words_of_root(row: u32) -> u32 { return 2u * params.first_group + 4u * (row - topology[7]); }

fn low_below(row: u32) -> vec4<u32> {
    let at = words_of_root(row);
    return vec4<u32>(atomicLoad(&costs[at]), atomicLoad(&costs[at + 1u]), atomicLoad(&costs[at + 2u]), atomicLoad(&costs[at + 3u]));
}

fn high_below(row: u32) -> vec3<u32> {
    let at = words_of_root(row) + 4u;
    return vec3<u32>(atomicLoad(&costs[at]), atomicLoad(&costs[at + 1u]), atomicLoad(&costs[at + 2u]));
}

// The parent of a treelet, and how many children that has which come here; read early, since it takes a while to come.
var<private> parent: u32;
var<private> siblings: u32;

fn look_ahead(number: u32) {
    parent = topology[ENTRY * number + 9u];
    siblings = 0u;
    if parent != NO_PARENT { siblings = topology[ENTRY * parent + 10u + params.listed]; }
}

// Leaves a treelet's roots to its parent.
fn hand_over(t: Treelet, local: u32) {
    for (var k = local; k < t.root_count; k += GROUP) {
        let place = topology[t.roots_at + k];
        let at = words_of_root(t.root_row + 2u * k);
        let low = row_of(t, place, false);
        let high = high_of(place);
        for (var i = 0u; i < 4u; i += 1u) {
            atomicStore(&costs[at + i], low[i]);
            atomicStore(&costs[at + 4u + i], high[i]);
        }
    }
}

// The parent, if its other children have all come; it is then empty for the next time.
fn parent_to_go_on_with() -> u32 {
    let came = 1u + atomicAdd(&costs[params.first_group + parent], 1u);
    if came != siblings { return NO_PARENT; }
    atomicStore(&costs[params.first_group + parent], 0u);
    return parent;
}

// Ends a treelet, whose boxes stand, and goes on upwards. All of a workgroup call it.
fn leave(first: u32, local: u32, area: f32) {
    let sum = sum_of_group(local, area);
    if local == 0u { keep_cost(first, sum); }
    let last = params.first_group - 1u;
    var t = treelet(first);
    var number = first;
    while params.first_group > 1u && number != last {
        hand_over(t, local);
        storageBarrier();
        // While the count is on its way the boxes are written.
        if local == 0u { next_treelet = parent_to_go_on_with(); }
        write_treelet(t, local);
        number = workgroupUniformLoad(&next_treelet);
        if number == NO_PARENT { return; }
        storageBarrier();
        look_ahead(number);
        t = treelet(number);
        let all = select(0u, params.first_group, number == last);
        add_up(t, number, local, all, refit_above(t, number, local, all));
    }
    write_treelet(t, local);
}
