//! Exact Euclidean distances on a lattice (Felzenszwalb & Huttenlocher 2012), and lines of a lattice.

/// Numbers on a box of a lattice, the first axis fastest.
#[derive(Debug, Clone)]
pub(super) struct Lattice<T> {
    pub(super) size: [usize; 3],
    pub(super) data: Vec<T>,
}

impl<T: Copy> Lattice<T> {
    /// From a function of the place.
    pub(super) fn of(size: [usize; 3], value: impl Fn([usize; 3]) -> T) -> Self {
        let mut data = Vec::with_capacity(size.iter().product());
        for k in 0..size[2] {
            for j in 0..size[1] {
                data.extend((0..size[0]).map(|i| value([i, j, k])));
            }
        }
        Self { size, data }
    }

    /// Where a place is in the data.
    pub(super) fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.size[0] * (j + self.size[1] * k)
    }

    /// First places of the lines along an axis, and the step from place to place.
    pub(super) fn lines(&self, axis: usize) -> (Vec<usize>, usize) {
        let step = self.size[..axis].iter().product();
        let others: [usize; 2] = [[1, 2], [0, 2], [0, 1]][axis];
        let mut firsts = Vec::with_capacity(self.size[others[0]] * self.size[others[1]]);
        for b in 0..self.size[others[1]] {
            for a in 0..self.size[others[0]] {
                let mut place = [0; 3];
                (place[others[0]], place[others[1]]) = (a, b);
                firsts.push(self.index(place));
            }
        }
        (firsts, step)
    }
}

/// Nearest marked place of every place, as places in the data; `u32::MAX` where nothing is marked. `steps` are the
/// sides of a cell.
pub(super) fn nearest(marked: &Lattice<bool>, steps: [f64; 3]) -> Vec<u32> {
    let mut found: Vec<u32> =
        marked.data.iter().enumerate().map(|(i, marked)| if *marked { i as u32 } else { u32::MAX }).collect();
    let mut square: Vec<f64> = marked.data.iter().map(|marked| if *marked { 0.0 } else { f64::INFINITY }).collect();
    for (axis, side) in steps.into_iter().enumerate() {
        let n = marked.size[axis];
        let (firsts, step) = marked.lines(axis);
        let mut line = Line::new(n, side);
        for first in firsts {
            for i in 0..n {
                (line.from[i], line.found[i]) = (square[first + i * step], found[first + i * step]);
            }
            line.run();
            for i in 0..n {
                (square[first + i * step], found[first + i * step]) = (line.to[i], line.became[i]);
            }
        }
    }
    found
}

/// A line of squared distances, and its lower envelope of parabolas.
struct Line {
    step: f64,
    from: Vec<f64>,
    found: Vec<u32>,
    to: Vec<f64>,
    became: Vec<u32>,
    /// Vertices of the envelope's parabolas, and from where on each is the lowest.
    vertex: Vec<usize>,
    begin: Vec<f64>,
}

impl Line {
    fn new(n: usize, step: f64) -> Self {
        let (zeros, none) = (vec![0.0; n], vec![u32::MAX; n]);
        Self {
            step,
            from: zeros.clone(),
            found: none.clone(),
            to: zeros.clone(),
            became: none,
            vertex: vec![0; n],
            begin: zeros,
        }
    }

    fn run(&mut self) {
        let n = self.from.len();
        let mut parabolas = 0;
        for q in (0..n).filter(|q| self.from[*q].is_finite()) {
            let begin = loop {
                let Some(last) = usize::checked_sub(parabolas, 1) else { break f64::NEG_INFINITY };
                let p = self.vertex[last];
                let (xq, xp) = (q as f64 * self.step, p as f64 * self.step);
                let meets = ((self.from[q] + xq * xq) - (self.from[p] + xp * xp)) / (2.0 * (xq - xp));
                if meets > self.begin[last] {
                    break meets;
                }
                parabolas -= 1;
            };
            (self.vertex[parabolas], self.begin[parabolas]) = (q, begin);
            parabolas += 1;
        }
        if parabolas == 0 {
            self.to.fill(f64::INFINITY);
            self.became.fill(u32::MAX);
            return;
        }
        let mut current = 0;
        for i in 0..n {
            let x = i as f64 * self.step;
            while current + 1 < parabolas && self.begin[current + 1] < x {
                current += 1;
            }
            let p = self.vertex[current];
            let away = x - p as f64 * self.step;
            (self.to[i], self.became[i]) = (away * away + self.from[p], self.found[p]);
        }
    }
}
