// How much of the absorbance lies in front of a depth, from four moments of it: the Hamburger moment problem.
// MOMENT_BIAS, OVERESTIMATION and MAX_EXPONENT are defines. renderer/techniques/moment.py has the mathematics.

// The orthogonal polynomials of degree 1 and 2 of the distribution: y = x - mean and y^2 - skew y - norm1, with their
// squared norms.
struct Distribution { float mean, skew, norm1, norm2; };

Distribution distribution_of(vec4 b) {  // normalised moments
    b = mix(b, vec4(0.0, 0.375, 0.0, 0.375), MOMENT_BIAS);
    Distribution d;
    d.mean = b.x;
    // Cholesky factors of the Hankel matrix. Rounding may not take the norms below what the bias alone leaves them.
    d.norm1 = max(b.y - b.x * b.x, 0.375 * MOMENT_BIAS);
    float slope = (b.z - b.x * b.y) / d.norm1;
    d.norm2 = max(b.w - b.y * b.y - slope * slope * d.norm1, 0.234375 * MOMENT_BIAS);
    d.skew = slope - 2.0 * b.x;
    return d;
}

// A root so far away has no mass: the result is its limit for a root at infinity.
float bounded_quotient(float a, float b) {
    const float farthest = 1e8;
    return abs(a) < farthest * abs(b) ? a / b : ((a < 0.0) == (b < 0.0) ? farthest : -farthest);
}

// The share of the absorbance in front of x: 0..1.
float share_before(Distribution d, float x) {
    float t = x - d.mean;
    float p = t * t - d.skew * t - d.norm1;
    float mass = 1.0 / (1.0 + t * t / d.norm1 + p * p / d.norm2);  // at t: the Christoffel number, 1 / K(t, t)
    // The representation that has a point at t has its other two at the roots y of K(t, y) = 0.
    float b = d.norm2 * t / d.norm1 - d.skew * p;
    float c = d.norm2 - d.norm1 * p;
    float sum = -0.5 * (b + (b < 0.0 ? -1.0 : 1.0) * sqrt(max(b * b - 4.0 * p * c, 0.0)));
    float y1 = bounded_quotient(sum, p);
    float y2 = bounded_quotient(c, sum);
    float low = min(y1, y2);
    float high = max(y1, y2);
    float before = 0.0;
    // Masses follow from the moments 0 and 1. Roots may be close to each other, but only on one side of t.
    if (high < t) before = 1.0 - mass;
    else if (low < t) before = clamp(((1.0 - mass) * high + mass * t) / (high - low), 0.0, 1.0 - mass);
    return before + OVERESTIMATION * mass;
}

// The transmittance at x, up to a factor that all fragments of a pixel share: it cancels in their mean. Where the
// transmittance could vanish at all of them, it is taken relative to the nearest.
float visibility(Distribution d, float total, float x) {
    float share = share_before(d, x);
    if (total > MAX_EXPONENT) share -= share_before(d, -1.0);
    return exp(-clamp(total * share, -MAX_EXPONENT, MAX_EXPONENT));
}
