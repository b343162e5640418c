// ln(1 + y), y > -1, to about one rounding: log(1.0 + y) loses the digits of a small y before it begins, and drivers'
// logarithms have an absolute error near 1.
float log1p(float y) {
    if (y < -0.5 || y > 1.0) return log(1.0 + y);
    float s = y / (2.0 + y);  // ln(1 + y) = 2 artanh(s), |s| <= 1/3
    float t = s * s;          // the series is cut where the rest is below 2e-9 of the sum
    float sum = 1.0 / 15.0;
    sum = sum * t + 1.0 / 13.0;
    sum = sum * t + 1.0 / 11.0;
    sum = sum * t + 1.0 / 9.0;
    sum = sum * t + 1.0 / 7.0;
    sum = sum * t + 1.0 / 5.0;
    sum = sum * t + 1.0 / 3.0;
    return 2.0 * s * (sum * t + 1.0);
}

// What a surface of opacity a < 1 adds to the optical depth: sums of it stand for products of 1 - a.
float optical_depth(float a) {
    return -log1p(-a);
}
