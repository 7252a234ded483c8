//! A cost map: a grid over the plane, each cell with its cost.

use crate::error::{Error, Result};
use crate::real::Real;
use crate::system::Disc;

/// Most cells of a map, its border included; their numbers are exact in f32.
pub const MAX_CELLS: usize = 1 << 22;

/// Where the cells of a map lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Lower corner of the first cell, m.
    pub origin: [f32; 2],
    /// Side of a cell, m.
    pub resolution: f32,
    /// Cells along x and along y.
    pub size: [usize; 2],
}

/// A cost for each cell of a grid, and one for the rest of the plane.
///
/// A border of one cell is kept around the grid, so that a point outside is clamped to a cell that
/// costs what the outside does, and no lookup needs to ask whether it is inside.
#[derive(Clone, Debug, PartialEq)]
pub struct CostMap {
    grid: Grid,
    /// With the border, `[rows + 2, columns + 2]`.
    cells: Vec<f32>,
}

/// A map and the point where it is looked up.
#[derive(Clone, Copy, Debug)]
pub struct Lookup<'a, R> {
    /// The map.
    pub map: &'a CostMap,
    /// The point on the plane, m.
    pub place: [R; 2],
}

impl CostMap {
    /// The map of `costs`, `[rows, columns]`: x runs along a row, y from row to row. Whatever lies
    /// outside costs `outside`.
    ///
    /// # Errors
    /// [`Error::Invalid`] for a grid without cells or with too many, a resolution that is not
    /// positive, a number that is not finite, or costs that are not as many as the cells.
    pub fn new(grid: Grid, costs: &[f32], outside: f32) -> Result<Self> {
        let bordered = grid.check()?;
        let [columns, rows] = grid.size;
        if costs.len() != columns * rows {
            let problem = format!("{} for {columns} x {rows} cells", costs.len());
            return Err(Error::invalid("costs of the map", problem));
        }
        if !costs.iter().chain([&outside]).all(|cost| cost.is_finite()) {
            return Err(Error::invalid("costs of the map", "one of them is not finite"));
        }
        let mut cells = vec![outside; bordered];
        let inner = cells.chunks_mut(columns + 2).skip(1);
        for (cells, costs) in inner.zip(costs.chunks(columns)) {
            cells[1..=columns].copy_from_slice(costs);
        }
        Ok(Self { grid, cells })
    }

    /// The map of round obstacles: `cost` where the centre of a cell lies in one, falling to 0 in
    /// proportion to the distance over the `inflation` around it, m. The outside costs `cost` too.
    ///
    /// # Errors
    /// As [`CostMap::new`]; also for an obstacle or inflation that is negative or not finite.
    pub fn around(grid: Grid, obstacles: &[Disc], inflation: f32, cost: f32) -> Result<Self> {
        grid.check()?;
        let sizes = obstacles.iter().map(|obstacle| obstacle.radius).chain([inflation]);
        let places = obstacles.iter().flat_map(|obstacle| obstacle.center);
        if !(sizes.clone().all(|size| size >= 0.0) && sizes.chain(places).all(f32::is_finite)) {
            let problem = "radius and inflation have to be finite and not negative";
            return Err(Error::invalid("obstacles of the map", problem));
        }
        let [columns, rows] = grid.size;
        let share = |[x, y]: [f32; 2]| {
            let each = obstacles.iter().map(|obstacle| obstacle.clearance(x, y));
            let clearance = each.fold(f32::INFINITY, f32::min);
            if clearance <= 0.0 { 1.0 } else { (1.0 - clearance / inflation).max(0.0) }
        };
        let cell = |number: usize| cost * share(grid.center([number % columns, number / columns]));
        let costs: Vec<f32> = (0..columns * rows).map(cell).collect();
        Self::new(grid, &costs, cost)
    }

    /// The number of the cell at a point, a whole number below that of [`CostMap::cells`]: a cell
    /// of the border outside the grid, NaN where a coordinate is.
    #[inline(always)]
    pub fn cell<R: Real>(&self, [x, y]: [R; 2]) -> R {
        let row = self.grid.cell_along(1, y);
        row * R::lit((self.grid.size[0] + 2) as f32) + self.grid.cell_along(0, x)
    }

    /// The cost of the cell of this number; NaN for one that is no number.
    pub fn at_cell(&self, cell: f32) -> f32 {
        let last = self.cells.len() - 1;
        if cell.is_nan() { cell } else { self.cells[(cell as usize).min(last)] }
    }

    /// The costs of the cells, the border's included, in order of their numbers.
    pub fn cells(&self) -> &[f32] {
        &self.cells
    }

    /// The grid.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }
}

impl Grid {
    /// Number of cells, with the border.
    fn check(&self) -> Result<usize> {
        let Self { origin, resolution, size: [columns, rows] } = *self;
        let per_metre = 1.0 / resolution;
        let finite = per_metre.is_finite() && origin.iter().all(|corner| corner.is_finite());
        if !(resolution > 0.0 && resolution.is_finite() && finite) {
            let problem = format!(
                "origin {origin:?} has to be finite, resolution {resolution} positive and finite"
            );
            return Err(Error::invalid("grid of the map", problem));
        }
        let side = |cells: usize| cells.checked_add(2).filter(|_| cells > 0);
        let bordered = side(columns).zip(side(rows)).and_then(|(a, b)| a.checked_mul(b));
        bordered.filter(|cells| *cells <= MAX_CELLS).ok_or_else(|| {
            let problem = format!(
                "{columns} x {rows} cells are none, or with their border more than {MAX_CELLS}"
            );
            Error::invalid("grid of the map", problem)
        })
    }

    /// The number of the cell at `x` along an axis, counted from the border before the grid and
    /// clamped to the borders.
    #[inline(always)]
    fn cell_along<R: Real>(&self, axis: usize, x: R) -> R {
        let cells = (x - R::lit(self.origin[axis])) * R::lit(1.0 / self.resolution);
        let from_border = cells.floor() + R::lit(1.0);
        from_border.clamp(R::lit(0.0), R::lit((self.size[axis] + 1) as f32))
    }

    /// Centre of the cell in column and row, m.
    fn center(&self, [column, row]: [usize; 2]) -> [f32; 2] {
        let [x, y] = self.origin;
        let middle = |origin: f32, cell: usize| origin + (cell as f32 + 0.5) * self.resolution;
        [middle(x, column), middle(y, row)]
    }
}
