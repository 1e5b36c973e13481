/* One rotation's transforms with FFTW, without pruning: prints, for each size N given, the
 * milliseconds of the fastest of several runs on one thread,
 *     N complex real
 * complex: one c2c forward of the moving field, product with a stored spectrum, one c2c back;
 * real:    two r2c forward (real and imaginary part), products summed, one c2r back.
 * Plans are made with FFTW_MEASURE. FFTW is under the GPL and no part of the program: this file
 * is compiled only when asked for. Build: cc -O3 -march=native correlate.c -lfftw3f -lm */
#include <fftw3.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

static void noise(float *v, size_t count)
{
    for (size_t i = 0; i < count; i++)
        v[i] = (float)rand() / RAND_MAX - 0.5f;
}

static double complex_loop(int n, double seconds)
{
    size_t points = (size_t)n * n * n;
    fftwf_complex *a = fftwf_alloc_complex(points), *b = fftwf_alloc_complex(points);
    fftwf_complex *s = fftwf_alloc_complex(points);
    fftwf_plan f = fftwf_plan_dft_3d(n, n, n, b, s, FFTW_FORWARD, FFTW_MEASURE);
    fftwf_plan g = fftwf_plan_dft_3d(n, n, n, s, s, FFTW_BACKWARD, FFTW_MEASURE);
    noise((float *)a, 2 * points);
    noise((float *)b, 2 * points);
    double best = 1e30, end = now() + seconds;
    do {
        double began = now();
        fftwf_execute(f);
        for (size_t i = 0; i < points; i++) {
            float re = s[i][0] * a[i][0] - s[i][1] * a[i][1];
            s[i][1] = s[i][0] * a[i][1] + s[i][1] * a[i][0];
            s[i][0] = re;
        }
        fftwf_execute(g);
        double took = now() - began;
        best = took < best ? took : best;
    } while (now() < end);
    fftwf_destroy_plan(f);
    fftwf_destroy_plan(g);
    fftwf_free(a);
    fftwf_free(b);
    fftwf_free(s);
    return 1e3 * best;
}

static double real_loop(int n, double seconds)
{
    size_t points = (size_t)n * n * n, half = (size_t)n * n * (n / 2 + 1);
    float *b[2], *out = fftwf_alloc_real(points);
    fftwf_complex *a[2], *s[2];
    fftwf_plan f[2];
    for (int p = 0; p < 2; p++) {
        b[p] = fftwf_alloc_real(points);
        a[p] = fftwf_alloc_complex(half);
        s[p] = fftwf_alloc_complex(half);
        f[p] = fftwf_plan_dft_r2c_3d(n, n, n, b[p], s[p], FFTW_MEASURE);
    }
    fftwf_plan g = fftwf_plan_dft_c2r_3d(n, n, n, s[0], out, FFTW_MEASURE);
    for (int p = 0; p < 2; p++) {
        noise((float *)a[p], 2 * half);
        noise(b[p], points);
    }
    double best = 1e30, end = now() + seconds;
    do {
        double began = now();
        fftwf_execute(f[0]);
        fftwf_execute(f[1]);
        for (size_t i = 0; i < half; i++) {
            float re = s[0][i][0] * a[0][i][0] - s[0][i][1] * a[0][i][1]
                     - s[1][i][0] * a[1][i][0] + s[1][i][1] * a[1][i][1];
            s[0][i][1] = s[0][i][0] * a[0][i][1] + s[0][i][1] * a[0][i][0]
                       - s[1][i][0] * a[1][i][1] - s[1][i][1] * a[1][i][0];
            s[0][i][0] = re;
        }
        fftwf_execute(g);
        double took = now() - began;
        best = took < best ? took : best;
    } while (now() < end);
    for (int p = 0; p < 2; p++) {
        fftwf_destroy_plan(f[p]);
        fftwf_free(a[p]);
        fftwf_free(b[p]);
        fftwf_free(s[p]);
    }
    fftwf_destroy_plan(g);
    fftwf_free(out);
    return 1e3 * best;
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fprintf(stderr, "usage: correlate SECONDS N...\n");
        return 2;
    }
    double seconds = atof(argv[1]);
    for (int i = 2; i < argc; i++) {
        int n = atoi(argv[i]);
        double c = complex_loop(n, seconds);
        double r = real_loop(n, seconds);
        printf("%d %.4f %.4f\n", n, c, r);
        fflush(stdout);
    }
    return 0;
}
