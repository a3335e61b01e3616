"""The peers: one class each. Peer(nodes, steps, tau, omega, law) takes (x, y, k, r) with curves on the last axis;
run() makes the steps from there and returns the last state, synchronously."""

import numpy as np

from scheme import bordered, observe, step


class Peer:
    """What compare.py asks of a peer."""

    curves: int  # side by side in one process
    on_cpu = True

    @classmethod
    def problem(cls):
        """Why it cannot run here, or nothing."""


class Alone(Peer):
    """One curve at a time, with NumPy's arrays and the solver of a subclass. Takes the first curve only."""

    curves = 1

    def __init__(self, state, steps, tau, omega, law):
        self.state = [np.ascontiguousarray(u[:, 0]) for u in state]
        self.steps, self.step = steps, lambda state: step(np, self.solve, state, tau, omega, law)

    def run(self):
        state = self.state
        for _ in range(self.steps):
            state = self.step(state)
            self.observed = observe(np, state)
        return [u[:, None] for u in state]


class Dense(Alone):
    """numpy.linalg.solve."""

    def __init__(self, state, *rest):
        super().__init__(state, *rest)
        n = len(state[0])
        i = np.arange(n)
        self.places = [i * n + (i + j) % n for j in (-2, -1, 0, 1, 2)]

    def solve(self, rows, rhs):
        n = len(rows[0])
        matrix = np.zeros(n * n)
        for place, row in zip(self.places, rows):
            matrix[place] = row
        return np.linalg.solve(matrix.reshape(n, n), np.stack(rhs, 1)).T


class Banded(Alone):
    """scipy.linalg.solve_banded, the periodic corners by bordering."""

    def __init__(self, *rest):
        super().__init__(*rest)
        from scipy.linalg import solve_banded

        def core(bands, columns):
            a, b, c, d, e = bands
            n = len(c)
            band = np.zeros((5, n))
            band[0, 2:], band[1, 1:], band[2], band[3, :-1], band[4, :-2] = e[:-2], d[:-1], c, b[1:], a[2:]
            return solve_banded((2, 2), band, np.stack(columns, 1), True, True, False).T

        self.solve = bordered(np, core)


class Jax(Peer):
    """jit of a scan over steps; in it the elimination, a scan over nodes with the curves side by side.

    Each iteration takes one array and leaves one: with an array for each coefficient it takes twice as long. More
    curves at once leave the cache, fewer do not hide the cost of an iteration.
    """

    curves = 64

    def __init__(self, state, steps, tau, omega, law):
        import jax
        import jax.numpy as jnp

        jax.config.update("jax_enable_x64", True)

        def core(bands, columns):
            def eliminate(above, row):
                two, one = above
                b = row[1] - row[0] * two[0]
                pivot = 1 / (row[2] - row[0] * two[1] - b * one[0])
                d, e = (row[3] - b * one[1]) * pivot, row[4] * pivot
                g = (row[5:] - row[0] * two[2:] - b * one[2:]) * pivot
                done = jnp.concatenate([d[None], e[None], g])
                return (one, done), done

            def put_back(below, row):
                two, one = below
                g = row[2:] - row[0] * one - row[1] * two
                return (one, g), g

            rows = jnp.stack([*bands, *columns], 1)
            none = jnp.zeros_like(rows[0, 3:])
            _, upper = jax.lax.scan(eliminate, (none, none), rows)
            _, solved = jax.lax.scan(put_back, (none[2:], none[2:]), upper, reverse=True)
            return [solved[:, column] for column in range(len(columns))]

        solve = bordered(jnp, core)

        def one_step(state, _):
            state = step(jnp, solve, state, tau, omega, law)
            return state, observe(jnp, state)

        self.all = jax.jit(lambda state: jax.lax.scan(one_step, state, None, steps))
        self.state = tuple(jnp.asarray(u) for u in state)

    def run(self):
        state, self.observed = self.all(self.state)
        return [np.asarray(u) for u in state]


class Cupy(Peer):
    """cuSPARSE's gpsvInterleavedBatch through CuPy, the periodic corners by bordering; needs a CUDA device."""

    curves = 8192
    on_cpu = False

    @classmethod
    def problem(cls):
        try:
            import cupy
        except ImportError:
            return "CuPy is not installed; for a CUDA device: pip install cupy-cuda12x into the peers' environment"
        try:
            cupy.cuda.runtime.getDeviceCount()
        except cupy.cuda.runtime.CUDARuntimeError as error:
            return f"no CUDA device ({error})"

    def __init__(self, state, steps, tau, omega, law):
        import cupy
        from cupy_backends.cuda.libs import cusparse

        handle = cupy.cuda.device.get_cusparse_handle()

        def core(bands, columns):
            # A system for each right-hand side, side by side: the call overwrites its matrix.
            systems = len(columns)
            bands = [cupy.tile(band, (1, systems)) for band in bands]
            g = cupy.concatenate(columns, 1)
            m, batch = g.shape
            pointers = [u.data.ptr for u in (*bands, g)]
            size = cusparse.dgpsvInterleavedBatch_bufferSizeExt(handle, 0, m, *pointers, batch)
            buffer = cupy.empty(size, cupy.int8)
            cusparse.dgpsvInterleavedBatch(handle, 0, m, *pointers, batch, buffer.data.ptr)
            return cupy.split(g, systems, 1)

        self.xp, self.solve, self.steps = cupy, bordered(cupy, core), steps
        self.step = lambda state: step(cupy, self.solve, state, tau, omega, law)
        self.state = [cupy.asarray(u) for u in state]

    def run(self):
        state = self.state
        for _ in range(self.steps):
            state = self.step(state)
            self.observed = observe(self.xp, state)
        return [u.get() for u in state]


PEERS = {"NumPy, dense": Dense, "SciPy, banded": Banded, "JAX, scan": Jax, "CuPy, gpsv": Cupy}
