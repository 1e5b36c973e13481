/* A stand-in for libdhd: the functions that pegfit calls, with a device in memory that a test
   moves and reads through the stub_ arrays. */
#include <stdatomic.h>
#include <stddef.h>

/* What the device calls itself. */
#ifndef STUB_NAME
#define STUB_NAME "stub.7"
#endif

_Atomic double stub_version[2] = {3, 17}, stub_count[1] = {1}, stub_type[1] = {104};
_Atomic double stub_power[1] = {1}, stub_reset[1] = {1}, stub_wrist[1] = {1}, stub_active[1] = {1};
_Atomic double stub_position[3], stub_velocity[3], stub_angular_velocity[3], stub_buttons[1];
/* Rows first. */
_Atomic double stub_frame[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
/* Every call fails with this code while it is set; opening fails with the other. */
_Atomic double stub_error[1], stub_open_error[1];
/* What the motors do, N and N m, the library's axes. */
_Atomic double stub_motor[6];
_Atomic double stub_gripper[1], stub_gravity[1], stub_closed[1];

static atomic_int last;
static int enabled;

static int done(void)
{
    last = (int)stub_error[0];
    return last ? -1 : 0;
}

static void rest(void)
{
    for (int k = 0; k < 6; k++)
        stub_motor[k] = 0;
}

void dhdGetSDKVersion(int *major, int *minor, int *release, int *revision)
{
    *major = (int)stub_version[0];
    *minor = (int)stub_version[1];
    *release = 6;
    *revision = 0;
}

int dhdGetDeviceCount(void) { return (int)stub_count[0]; }

int dhdOpenID(char id)
{
    last = (int)(stub_open_error[0] != 0 ? stub_open_error[0] : stub_error[0]);
    return last ? -1 : id;
}

int dhdClose(char id)
{
    (void)id;
    rest();
    stub_closed[0] = stub_closed[0] + 1;
    return 0;
}

int dhdStop(char id)
{
    (void)id;
    rest();
    return done();
}

int dhdErrorGetLast(void) { return last; }

const char *dhdErrorGetLastStr(void) { return last ? "as the stub was told" : "no error"; }

const char *dhdGetSystemName(char id)
{
    (void)id;
    return STUB_NAME;
}

int dhdGetSystemType(char id)
{
    (void)id;
    return (int)stub_type[0];
}

int dhdGetSerialNumber(unsigned short *serial, char id)
{
    *serial = (unsigned short)(4000 + id);
    return 0;
}

int dhdGetStatus(int *status, char id)
{
    (void)id;
    for (int k = 0; k < 16; k++)
        status[k] = 0;
    status[0] = (int)stub_power[0];
    status[3] = (int)stub_reset[0];
    return done();
}

unsigned char dhdHasWrist(char id)
{
    (void)id;
    return stub_wrist[0] != 0;
}

unsigned char dhdHasActiveWrist(char id)
{
    (void)id;
    return stub_active[0] != 0;
}

int dhdSetGravityCompensation(int value, char id)
{
    (void)id;
    stub_gravity[0] = value;
    return done();
}

int dhdEnableForce(unsigned char value, char id)
{
    (void)id;
    enabled = value;
    return done();
}

int dhdGetPositionAndOrientationFrame(double *x, double *y, double *z, double frame[3][3], char id)
{
    (void)id;
    *x = stub_position[0];
    *y = stub_position[1];
    *z = stub_position[2];
    for (int k = 0; k < 9; k++)
        frame[k / 3][k % 3] = stub_frame[k];
    return done();
}

int dhdGetLinearVelocity(double *x, double *y, double *z, char id)
{
    (void)id;
    *x = stub_velocity[0];
    *y = stub_velocity[1];
    *z = stub_velocity[2];
    return done();
}

int dhdGetAngularVelocityRad(double *x, double *y, double *z, char id)
{
    (void)id;
    *x = stub_angular_velocity[0];
    *y = stub_angular_velocity[1];
    *z = stub_angular_velocity[2];
    return done();
}

unsigned int dhdGetButtonMask(char id)
{
    (void)id;
    return (unsigned int)stub_buttons[0];
}

#ifndef WITHOUT_WRENCH
int dhdSetForceAndTorqueAndGripperForce(double fx, double fy, double fz, double tx, double ty,
                                        double tz, double grip, char id)
{
    (void)id;
    double wrench[6] = {fx, fy, fz, tx, ty, tz};
    int result = done();
    for (int k = 0; k < 6; k++)
        stub_motor[k] = enabled && result == 0 ? wrench[k] : 0;
    stub_gripper[0] = grip;
    /* A remark, not an error: DHD_MOTOR_SATURATED. */
    return result == 0 ? 2 : result;
}
#endif
