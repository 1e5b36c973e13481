/* A stand-in for libHD: the functions that pegfit calls, with a device in memory that a test
   moves and reads through the stub_ arrays. */
#include <pthread.h>
#include <stdatomic.h>
#include <stddef.h>
#include <string.h>
#include <time.h>

/* Who the device says has made it. */
#ifndef STUB_VENDOR
#define STUB_VENDOR "Stub"
#endif

typedef unsigned int (*Callback)(void *);
typedef struct {
    unsigned int code;
    int internal;
    unsigned int device;
} ErrorInfo;

_Atomic double stub_transform[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
_Atomic double stub_velocity[3], stub_angular_velocity[3], stub_buttons[1];
_Atomic double stub_calibration[1] = {0x5000}, stub_style[1] = {4}, stub_output_dof[1] = {3};
/* Raised when a device is opened, and at the end of every frame. */
_Atomic double stub_init_error[1], stub_error[1];
/* The scheduler calls nobody while this is set. */
_Atomic double stub_stands_still[1];
/* What the motors do, N and mN m, the library's axes. */
_Atomic double stub_motor[6];
_Atomic double stub_opened[1];

static double asked[6];
static int enabled;
static ErrorInfo errors[16];
static int depth;
static char opened_as[64];

static void raise_error(unsigned int code)
{
    if (code && depth < 16)
        errors[depth++] = (ErrorInfo){code, -7, 0};
}

static void rest(void)
{
    for (int k = 0; k < 6; k++)
        stub_motor[k] = 0;
}

unsigned int hdInitDevice(const char *name)
{
    raise_error((unsigned int)stub_init_error[0]);
    if (stub_init_error[0] != 0)
        return 0xffffffffu;
    strncpy(opened_as, name ? name : "", sizeof opened_as - 1);
    stub_opened[0] = stub_opened[0] + 1;
    return 0;
}

void hdDisableDevice(unsigned int device)
{
    (void)device;
    rest();
}

void hdMakeCurrentDevice(unsigned int device) { (void)device; }

void hdEnable(unsigned int what) { enabled |= what == 0x4000; }

void hdDisable(unsigned int what)
{
    if (what != 0x4000)
        return;
    enabled = 0;
    rest();
}

void hdBeginFrame(unsigned int device) { (void)device; }

void hdEndFrame(unsigned int device)
{
    (void)device;
    unsigned int error = (unsigned int)stub_error[0];
    for (int k = 0; k < 6; k++)
        stub_motor[k] = enabled && !error ? asked[k] : 0;
    raise_error(error);
}

static void copy(double *to, _Atomic double *from, int count)
{
    for (int k = 0; k < count; k++)
        to[k] = from[k];
}

void hdGetDoublev(unsigned int what, double *out)
{
    static const double workspace[6] = {-210, -110, -85, 210, 205, 130};
    switch (what) {
    case 0x2051: copy(out, stub_velocity, 3); break;
    case 0x2052: copy(out, stub_transform, 16); break;
    case 0x2053: copy(out, stub_angular_velocity, 3); break;
    case 0x2550: memcpy(out, workspace, sizeof workspace); break;
    case 0x2602: *out = 0.5; break;
    case 0x2603: *out = 3.3; break;
    case 0x2620: *out = 800; break;
    case 0x2622: *out = 180; break;
    default: raise_error(0x0100);
    }
}

void hdGetIntegerv(unsigned int what, int *out)
{
    switch (what) {
    case 0x2000: *out = (int)stub_buttons[0]; break;
    case 0x2553: *out = 6; break;
    case 0x2554: *out = (int)stub_output_dof[0]; break;
    case 0x2555: *out = (int)stub_style[0]; break;
    case 0x2600: *out = 1000; break;
    default: raise_error(0x0100);
    }
}

const char *hdGetString(unsigned int what)
{
    switch (what) {
    case 0x2501: return opened_as[0] ? opened_as : "Touch";
    case 0x2503: return STUB_VENDOR;
    case 0x2504: return "SN1234";
    default: raise_error(0x0100); return NULL;
    }
}

void hdSetDoublev(unsigned int what, const double *values)
{
    memcpy(asked + (what == 0x2701 ? 3 : 0), values, 3 * sizeof *values);
}

ErrorInfo hdGetError(void)
{
    return depth ? errors[--depth] : (ErrorInfo){0, 0, 0};
}

const char *hdGetErrorString(unsigned int code) { return code ? "as the stub was told" : ""; }

unsigned int hdCheckCalibration(void) { return (unsigned int)stub_calibration[0]; }

void hdUpdateCalibration(unsigned int style)
{
    if (style == (unsigned int)stub_style[0])
        stub_calibration[0] = 0x5000;
}

static pthread_t thread;
static atomic_int running, scheduled;
static Callback callback;
static void *data;

static void *schedule(void *unused)
{
    struct timespec tick = {0, 1000000};
    while (running) {
        nanosleep(&tick, NULL);
        if (scheduled && stub_stands_still[0] == 0 && callback(data) == 0)
            scheduled = 0;
    }
    return unused;
}

void hdStartScheduler(void)
{
    if (!running) {
        running = 1;
        pthread_create(&thread, NULL, schedule, NULL);
    }
}

void hdStopScheduler(void)
{
    if (running) {
        running = 0;
        pthread_join(thread, NULL);
    }
}

unsigned long hdScheduleAsynchronous(Callback called, void *with, unsigned short priority)
{
    (void)priority;
    callback = called;
    data = with;
    scheduled = 1;
    return 1;
}

#ifndef WITHOUT_UNSCHEDULE
void hdUnschedule(unsigned long handle)
{
    (void)handle;
    scheduled = 0;
}
#endif
