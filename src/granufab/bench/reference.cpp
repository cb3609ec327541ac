// The yardstick of `granufab bench`: one Gauss–Seidel sweep over the contacts of a stored problem
// in plain C++, the same algorithm in the same contact order as granufab/kernels/sweep.py.
//
// Bodies are records of 4 doubles (v_x, v_y, s = R ω, 1/m) in 2D and 8 (v, s, 1/m, 0) in 3D;
// contacts are separate streams in solve order. Both bodies are loaded into locals, the contact's
// Signorini–Coulomb problem is solved exactly with the implicit compliance eps, the change is
// stored. Impulses are extrapolated as momentum wants. The uniform dilation of the cell is one more body; its change is handed on every `lag`
// contacts.

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace {

struct Problem {
    std::int64_t count;            // contacts
    std::int64_t lag;              // contacts between two updates of the dilation
    const std::int32_t* first;     // body i
    const std::int32_t* second;    // body j
    const double* normal;          // from i to j, 2 or 3 columns
    const double* length;          // of the branch
    const double* offset_n;        // velocity offsets
    const double* offset_t;        // 1 or 3 columns
    const double* mu;              // friction
    const double* inverse_n;       // 1/(W_nn + eps), the cell's share included
    const double* inverse_t;       // 1/(W_tt + eps)
    double eps;                    // 1/(k h²)
    double kappa;                  // m R²/I
    double w_cell;                 // 1/(D M) of the dilation
    double* motion;                // body records
    double* impulse_n;
    double* impulse_t;             // 1 or 3 columns
    double* before_n;              // impulses of the iterate before
    double* before_t;
    double beta;                   // momentum: the sweep starts from x + beta (x - before)
    double* dilation;              // and, after it, the squared length of all impulses
};

struct Disk {
    double x, y, spin, w;
};

struct Vector {
    double x, y, z;
};

struct Sphere {
    Vector v, s;
    double w, unused;
};

inline Vector operator+(Vector a, Vector b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vector operator-(Vector a, Vector b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vector operator*(double f, Vector a) { return {f * a.x, f * a.y, f * a.z}; }
inline double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector cross(Vector a, Vector b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

double sweep_disks(const Problem& p) {
    Disk* __restrict bodies = reinterpret_cast<Disk*>(p.motion);
    double* __restrict impulse_n = p.impulse_n;
    double* __restrict impulse_t = p.impulse_t;
    double* __restrict before_n = p.before_n;
    double* __restrict before_t = p.before_t;
    const double beta = p.beta;
    const double eps = p.eps, kappa = p.kappa, w_cell = p.w_cell;
    double dilation = *p.dilation, pending = 0.0, moved = 0.0, length2 = 0.0;
    std::int64_t until = p.lag;
    for (std::int64_t c = 0; c < p.count; ++c) {
        Disk& body_i = bodies[p.first[c]];
        Disk& body_j = bodies[p.second[c]];
        const Disk i = body_i, j = body_j;
        const double nx = p.normal[2 * c], ny = p.normal[2 * c + 1], length = p.length[c];
        const double x_n = impulse_n[c], x_t = impulse_t[c];
        const double p_n = x_n + beta * (x_n - before_n[c]);
        const double p_t = x_t + beta * (x_t - before_t[c]);
        before_n[c] = x_n;
        before_t[c] = x_t;
        const double ux = j.x - i.x, uy = j.y - i.y;
        const double u_n = nx * ux + ny * uy + p.offset_n[c] + eps * p_n + dilation * length;
        const double u_t = nx * uy - ny * ux - (i.spin + j.spin) + p.offset_t[c] + eps * p_t;
        const double new_n = std::max(0.0, p_n - u_n * p.inverse_n[c]);
        const double stick = p_t - u_t * p.inverse_t[c];
        const double most = p.mu[c] * new_n;
        const double new_t = std::min(std::max(stick, -most), most);
        const double d_n = new_n - p_n, d_t = new_t - p_t;
        moved += d_n * d_n + d_t * d_t;
        length2 += new_n * new_n + new_t * new_t;
        impulse_n[c] = new_n;
        impulse_t[c] = new_t;
        const double fx = d_n * nx - d_t * ny, fy = d_n * ny + d_t * nx, turn = kappa * d_t;
        // field by field: a whole record stored in halves is slow to load again
        body_i.x = i.x - i.w * fx;
        body_i.y = i.y - i.w * fy;
        body_i.spin = i.spin - i.w * turn;
        body_j.x = j.x + j.w * fx;
        body_j.y = j.y + j.w * fy;
        body_j.spin = j.spin - j.w * turn;
        pending += w_cell * length * d_n;
        if (--until == 0) {
            until = p.lag;
            dilation += pending;
            pending = 0.0;
        }
    }
    p.dilation[0] = dilation + pending;
    p.dilation[1] = length2;
    return moved;
}

double sweep_spheres(const Problem& p) {
    Sphere* __restrict bodies = reinterpret_cast<Sphere*>(p.motion);
    const Vector* normal = reinterpret_cast<const Vector*>(p.normal);
    const Vector* offset_t = reinterpret_cast<const Vector*>(p.offset_t);
    double* __restrict impulse_n = p.impulse_n;
    Vector* __restrict impulse_t = reinterpret_cast<Vector*>(p.impulse_t);
    double* __restrict before_n = p.before_n;
    Vector* __restrict before_t = reinterpret_cast<Vector*>(p.before_t);
    const double beta = p.beta;
    const double eps = p.eps, kappa = p.kappa, w_cell = p.w_cell;
    double dilation = *p.dilation, pending = 0.0, moved = 0.0, length2 = 0.0;
    std::int64_t until = p.lag;
    for (std::int64_t c = 0; c < p.count; ++c) {
        Sphere& body_i = bodies[p.first[c]];
        Sphere& body_j = bodies[p.second[c]];
        const Sphere i = body_i, j = body_j;
        const Vector n = normal[c], x_t = impulse_t[c];
        const double length = p.length[c], x_n = impulse_n[c];
        const double p_n = x_n + beta * (x_n - before_n[c]);
        const Vector p_t = x_t + beta * (x_t - before_t[c]);
        before_n[c] = x_n;
        before_t[c] = x_t;
        const Vector u = j.v - i.v;
        const double along = dot(n, u);
        const Vector u_t = u - along * n - cross(i.s + j.s, n) + offset_t[c] + eps * p_t;
        const double u_n = along + p.offset_n[c] + eps * p_n + dilation * length;
        const double new_n = std::max(0.0, p_n - u_n * p.inverse_n[c]);
        const Vector stick = p_t - p.inverse_t[c] * u_t;
        const double size = std::max(std::sqrt(dot(stick, stick)), 1e-300);
        const double share = std::min(1.0, p.mu[c] * new_n / size);
        const Vector new_t = share * stick;
        const double d_n = new_n - p_n;
        const Vector d_t = new_t - p_t;
        moved += d_n * d_n + dot(d_t, d_t);
        length2 += new_n * new_n + dot(new_t, new_t);
        impulse_n[c] = new_n;
        impulse_t[c] = new_t;
        const Vector push = d_n * n + d_t, turn = kappa * cross(n, d_t);
        body_i.v = i.v - i.w * push;
        body_j.v = j.v + j.w * push;
        body_i.s = i.s - i.w * turn;
        body_j.s = j.s - j.w * turn;
        pending += w_cell * length * d_n;
        if (--until == 0) {
            until = p.lag;
            dilation += pending;
            pending = 0.0;
        }
    }
    p.dilation[0] = dilation + pending;
    p.dilation[1] = length2;
    return moved;
}

}  // namespace

// Both make `sweeps` sweeps and return Σ|ΔP|² of the last one.
extern "C" double sweep_2d(const Problem* problem, std::int64_t sweeps) {
    double moved = 0.0;
    for (std::int64_t k = 0; k < sweeps; ++k) moved = sweep_disks(*problem);
    return moved;
}

extern "C" double sweep_3d(const Problem* problem, std::int64_t sweeps) {
    double moved = 0.0;
    for (std::int64_t k = 0; k < sweeps; ++k) moved = sweep_spheres(*problem);
    return moved;
}
