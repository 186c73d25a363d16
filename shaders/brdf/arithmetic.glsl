// Provides: what translated quotients (ui/gl/python_to_glsl.py) call of Python's math, to a few units in the last place
// of single precision. GLSL's own exp, log, atan and acos may be a thousand times less exact, near 1 and 0 above all.

const float LN2_HIGH = 0.693145751953125;  // its product with an exponent is exact
const float LN2_LOW = 1.42860682e-6;

// 2 artanh(s) = ln((1 + s) / (1 - s)) for |s| <= 1/3.
float twice_artanh(float s) {
    float s2 = s * s;
    float tail = s2 * (1.0 / 3.0 + s2 * (1.0 / 5.0 + s2 * (1.0 / 7.0 + s2 * (1.0 / 9.0 + s2 * (1.0 / 11.0
        + s2 * (1.0 / 13.0 + s2 / 15.0))))));
    return 2.0 * (s + s * tail);
}

// ln x of x > 0.
float logarithm(float x) {
    uint bits = floatBitsToUint(max(x, 1.1754944e-38)) - 0x3f3504f3u;  // less sqrt(1/2)
    float exponent = float(int(bits) >> 23);
    float m = uintBitsToFloat((bits & 0x007fffffu) + 0x3f3504f3u);     // in [sqrt(1/2), sqrt(2))
    return exponent * LN2_HIGH + (twice_artanh((m - 1.0) / (m + 1.0)) + exponent * LN2_LOW);
}

// ln(1 + x) of x > -1.
float logarithm_of_1_and(float x) {
    return abs(x) <= 0.5 ? twice_artanh(x / (2.0 + x)) : logarithm(1.0 + x);
}

// e^r - 1 for |r| <= 0.36.
float small_exponential_less_1(float r) {
    float tail = r * (1.0 / 2.0 + r * (1.0 / 6.0 + r * (1.0 / 24.0 + r * (1.0 / 120.0 + r * (1.0 / 720.0
        + r * (1.0 / 5040.0 + r / 40320.0))))));
    return r + r * tail;
}

// e^x, 0 below e^-87.
float exponential(float x) {
    if (x < -87.0) {
        return 0.0;
    }
    float n = floor(1.44269504 * min(x, 88.0) + 0.5);
    float r = (min(x, 88.0) - n * LN2_HIGH) - n * LN2_LOW;
    return uintBitsToFloat(uint(int(n) + 127) << 23) * (1.0 + small_exponential_less_1(r));
}

float exponential_less_1(float x) {
    return abs(x) <= 0.36 ? small_exponential_less_1(x) : exponential(x) - 1.0;
}

// arctan x: Abramowitz and Stegun, 4.4.49, error 2e-8.
float arc_tangent_of(float x) {
    float a = abs(x), t = a > 1.0 ? 1.0 / a : a, t2 = t * t;
    float tail = t2 * (-0.3333314528 + t2 * (0.1999355085 + t2 * (-0.1420889944 + t2 * (0.1065626393
        + t2 * (-0.0752896400 + t2 * (0.0429096138 + t2 * (-0.0161657367 + t2 * 0.0028662257)))))));
    float arc = t + t * tail;
    return (a > 1.0 ? 1.57079633 - arc : arc) * (x < 0.0 ? -1.0 : 1.0);
}

// The angle of (x, y), 0 for (0, 0).
float arc_tangent(float y, float x) {
    if (x == 0.0) {
        return y == 0.0 ? 0.0 : y > 0.0 ? 1.57079633 : -1.57079633;
    }
    float arc = arc_tangent_of(y / x);
    return x > 0.0 ? arc : y >= 0.0 ? arc + 3.14159265 : arc - 3.14159265;
}

float arc_cosine(float x) {
    return arc_tangent(sqrt(max((1.0 - x) * (1.0 + x), 0.0)), x);
}

float arc_sine(float x) {
    return arc_tangent(x, sqrt(max((1.0 - x) * (1.0 + x), 0.0)));
}

// x^y; of a negative x for whole y.
float power(float x, float y) {
    if (x == 0.0) {
        return y == 0.0 ? 1.0 : 0.0;
    }
    float magnitude = exponential(y * logarithm(abs(x)));
    return x < 0.0 && mod(y, 2.0) != 0.0 ? -magnitude : magnitude;
}

float hypotenuse(float x, float y) {
    return sqrt(x * x + y * y);
}
