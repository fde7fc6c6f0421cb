/* A chain with Coulomb friction as a co-simulation FMU (FMI 2.0). chain_data.h holds its numbers.
 *
 * Runge-Kutta steps of order 4, short against the fastest motion, with bodies that slip forwards, backwards or
 * stick in each of them; a change of that is looked for by bisection, so that friction is neither smoothed nor late.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "chain_data.h"

#if defined _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void *fmi2Component;
typedef void *fmi2ComponentEnvironment;
typedef void *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer;
typedef int fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;
typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;
typedef void (*Logger)(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);
typedef struct {
    Logger logger;
    void *(*allocateMemory)(size_t, size_t);
    void (*freeMemory)(void *);
    void (*stepFinished)(fmi2ComponentEnvironment, fmi2Status);
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

#define STATES (2 * BODIES)
#define STEP_SHARE 0.1       /* of the time in which the fastest motion turns by a radian */
#define MOST_STEPS 100000000 /* in one communication step */
#define MOST_EVENTS 1000     /* in one internal step */
#define HALVINGS 50

typedef struct {
    double parameter[PARAMETERS + 1], input[ACTUATORS + 1], slope[ACTUATORS + 1];
    double state[STATES], time, input_time;
    int mode[BODIES], started;
    Logger logger;
    fmi2ComponentEnvironment environment;
    char name[256];
} Chain;

static double value(const Chain *chain, int index) { return index < 0 ? 0.0 : chain->parameter[index]; }

/* Forces on the bodies but for Coulomb friction; `mode` chooses between two sizes of viscous friction. */
static void forces(const Chain *chain, const double *state, double time, const int *mode, double *force) {
    const double *position = state, *speed = state + BODIES;
    for (int i = 0; i < BODIES; i++) {
        int viscous = mode[i] < 0 ? viscous_minus[i] : viscous_plus[i];
        force[i] = -value(chain, offset[i]) - value(chain, viscous) * speed[i];
    }
    for (int k = 0; k < ACTUATORS; k++)
        force[actuator_body[k]] += chain->input[k] + chain->slope[k] * (time - chain->input_time);
    for (int k = 0; k < SPRINGS; k++) {
        double stretch = 0.0, rate = 0.0;
        for (int i = 0; i < BODIES; i++) {
            stretch += spring_lever[k][i] * position[i];
            rate += spring_lever[k][i] * speed[i];
        }
        double pull = value(chain, stiffness[k]) * stretch + value(chain, damping[k]) * rate
                      + value(chain, stiffness3[k]) * stretch * stretch * stretch;
        for (int i = 0; i < BODIES; i++) force[i] -= spring_lever[k][i] * pull;
    }
}

static void slopes(const Chain *chain, const double *state, double time, const int *mode, double *slope) {
    double force[BODIES];
    forces(chain, state, time, mode, force);
    for (int i = 0; i < BODIES; i++) {
        double friction = mode[i] < 0 ? -value(chain, coulomb_minus[i]) : value(chain, coulomb_plus[i]);
        slope[i] = rubs[i] && mode[i] == 0 ? 0.0 : state[BODIES + i];
        slope[BODIES + i] = 0.0;
        if (!rubs[i]) slope[BODIES + i] = force[i] / value(chain, inertia[i]);
        else if (mode[i] != 0) slope[BODIES + i] = (force[i] - friction) / value(chain, inertia[i]);
    }
}

static void runge_kutta(const Chain *chain, const double *from, double step, double *to) {
    static const double share[3] = {0.5, 0.5, 1.0};
    double k[4][STATES], middle[STATES];
    slopes(chain, from, chain->time, chain->mode, k[0]);
    for (int stage = 0; stage < 3; stage++) {
        for (int i = 0; i < STATES; i++) middle[i] = from[i] + share[stage] * step * k[stage][i];
        slopes(chain, middle, chain->time + share[stage] * step, chain->mode, k[stage + 1]);
    }
    for (int i = 0; i < STATES; i++) to[i] = from[i] + step / 6.0 * (k[0][i] + 2.0 * (k[1][i] + k[2][i]) + k[3][i]);
}

/* The way a body at rest would go under a force: forwards, backwards, or not. */
static int way(const Chain *chain, int body, double force) {
    if (force > value(chain, coulomb_plus[body])) return 1;
    return force < -value(chain, coulomb_minus[body]) ? -1 : 0;
}

static int leaves_mode(const Chain *chain, const double *state, double time) {
    double force[BODIES];
    forces(chain, state, time, chain->mode, force);
    for (int i = 0; i < BODIES; i++) {
        if (!rubs[i]) continue;
        if (chain->mode[i] ? state[BODIES + i] * chain->mode[i] < 0.0 : way(chain, i, force[i]) != 0) return 1;
    }
    return 0;
}

/* Give every body at rest, or past its turning point, the mode that the force on it asks for. */
static void choose_modes(Chain *chain) {
    double force[BODIES];
    for (int i = 0; i < BODIES; i++) {
        double speed = chain->state[BODIES + i];
        if (!rubs[i]) continue;
        if (chain->started && speed * chain->mode[i] < 0.0) chain->state[BODIES + i] = speed = 0.0;
        if (chain->started && chain->mode[i] == 0) chain->state[BODIES + i] = speed = 0.0;
        if (speed != 0.0) chain->mode[i] = speed > 0.0 ? 1 : -1;
    }
    forces(chain, chain->state, chain->time, chain->mode, force);
    for (int i = 0; i < BODIES; i++)
        if (rubs[i] && chain->state[BODIES + i] == 0.0) chain->mode[i] = way(chain, i, force[i]);
    chain->started = 1;
}

static void advance(Chain *chain, double step) {
    double end[STATES], target = chain->time + step;
    for (int events = 0; events < MOST_EVENTS && step > 0.0; events++) {
        runge_kutta(chain, chain->state, step, end);
        if (!leaves_mode(chain, end, chain->time + step)) break;
        double before = 0.0, after = step;
        for (int n = 0; n < HALVINGS && after - before > 1e-15 * step; n++) {
            double middle = 0.5 * (before + after);
            runge_kutta(chain, chain->state, middle, end);
            if (leaves_mode(chain, end, chain->time + middle)) after = middle;
            else before = middle;
        }
        runge_kutta(chain, chain->state, after, end);
        memcpy(chain->state, end, sizeof end);
        chain->time += after;
        choose_modes(chain);
        step = target - chain->time;
    }
    if (step > 0.0) {
        runge_kutta(chain, chain->state, step, end);
        memcpy(chain->state, end, sizeof end);
    }
    chain->time = target;
    choose_modes(chain);
}

/* A bound of the eigenvalues: the largest sums of rows of stiffness and damping, made symmetric by the inertias. */
static double fastest(const Chain *chain) {
    double turning = 0.0, decay = 0.0;
    for (int i = 0; i < BODIES; i++) {
        double plus = fabs(value(chain, viscous_plus[i])), minus = fabs(value(chain, viscous_minus[i]));
        double row = 0.0, rate = (plus > minus ? plus : minus) / value(chain, inertia[i]);
        for (int k = 0; k < SPRINGS; k++) {
            double stretch = 0.0;
            for (int j = 0; j < BODIES; j++) stretch += spring_lever[k][j] * chain->state[j];
            double hardened = fabs(value(chain, stiffness[k])) + 3.0 * fabs(value(chain, stiffness3[k])) * stretch * stretch;
            for (int j = 0; j < BODIES; j++) {
                double lever = fabs(spring_lever[k][i] * spring_lever[k][j])
                               / sqrt(value(chain, inertia[i]) * value(chain, inertia[j]));
                row += hardened * lever;
                rate += fabs(value(chain, damping[k])) * lever;
            }
        }
        if (row > turning) turning = row;
        if (rate > decay) decay = rate;
    }
    return sqrt(turning) + decay;
}

static fmi2Status complain(const Chain *chain, fmi2Status status, const char *message) {
    if (chain->logger) chain->logger(chain->environment, chain->name, status, "logStatusError", "%s", message);
    return status;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[]) {
    (void)c, (void)on, (void)n, (void)names;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    Chain *chain = c;
    memcpy(chain->parameter, parameter_start, sizeof parameter_start);
    memset(chain->input, 0, sizeof chain->input);
    memset(chain->slope, 0, sizeof chain->slope);
    memset(chain->state, 0, sizeof chain->state);
    memset(chain->mode, 0, sizeof chain->mode);
    chain->time = chain->input_time = 0.0;
    chain->started = 0;
    return fmi2OK;
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean log) {
    (void)resources, (void)visible, (void)log;
    if (type != fmi2CoSimulation || !guid || strcmp(guid, GUID) != 0) return NULL;
    Chain *chain = calloc(1, sizeof *chain);
    if (!chain) return NULL;
    if (functions) {
        chain->logger = functions->logger;
        chain->environment = functions->componentEnvironment;
    }
    if (name) strncpy(chain->name, name, sizeof chain->name - 1);
    fmi2Reset(chain);
    return chain;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { free(c); }

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean defined, fmi2Real tolerance, fmi2Real start,
                                      fmi2Boolean ends, fmi2Real stop) {
    (void)defined, (void)tolerance, (void)ends, (void)stop;
    ((Chain *)c)->time = ((Chain *)c)->input_time = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    choose_modes(c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    (void)c;
    return fmi2OK;
}

/* Variables: parameters, inputs, outputs, positions, speeds. */
static double *variable(Chain *chain, fmi2ValueReference reference) {
    if (reference < PARAMETERS) return chain->parameter + reference;
    reference -= PARAMETERS;
    if (reference < ACTUATORS) return chain->input + reference;
    reference -= ACTUATORS;
    if (reference < READINGS || reference >= READINGS + STATES) return NULL;
    return chain->state + (reference - READINGS);
}

static double reading(const Chain *chain, int index) {
    double slope[STATES], sum = 0.0;
    slopes(chain, chain->state, chain->time, chain->mode, slope);
    const double *source = reading_order[index] == 0 ? chain->state
                           : reading_order[index] == 1 ? chain->state + BODIES : slope + BODIES;
    for (int i = 0; i < BODIES; i++) sum += reading_lever[index][i] * source[i];
    return sum;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real values[]) {
    Chain *chain = c;
    if (!chain->started) choose_modes(chain), chain->started = 0;
    for (size_t k = 0; k < n; k++) {
        const double *found = variable(chain, vr[k]);
        if (found) values[k] = *found;
        else if (vr[k] >= PARAMETERS + ACTUATORS && vr[k] < PARAMETERS + ACTUATORS + READINGS)
            values[k] = reading(chain, (int)(vr[k] - PARAMETERS - ACTUATORS));
        else return complain(chain, fmi2Error, "no such variable");
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real values[]) {
    Chain *chain = c;
    for (size_t k = 0; k < n; k++) {
        double *found = variable(chain, vr[k]);
        if (!found) return complain(chain, fmi2Error, "no such variable, or one that is calculated");
        if (!isfinite(values[k])) return complain(chain, fmi2Error, "a value that is not finite");
        *found = values[k];
        if (vr[k] >= PARAMETERS && vr[k] < PARAMETERS + ACTUATORS) {
            chain->slope[vr[k] - PARAMETERS] = 0.0;
            chain->input_time = chain->time;
        }
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                              const fmi2Integer order[], const fmi2Real values[]) {
    Chain *chain = c;
    for (size_t k = 0; k < n; k++) {
        if (vr[k] < PARAMETERS || vr[k] >= PARAMETERS + ACTUATORS || order[k] != 1 || !isfinite(values[k]))
            return complain(chain, fmi2Error, "no input, a derivative above the first, or no finite number");
        chain->slope[vr[k] - PARAMETERS] = values[k];
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean fixed) {
    Chain *chain = c;
    (void)fixed;
    for (int i = 0; i < BODIES; i++)
        if (!(value(chain, inertia[i]) > 0.0)) return complain(chain, fmi2Error, "an inertia is not positive");
    if (!isfinite(step) || step < 0.0) return complain(chain, fmi2Error, "a step that is no time");
    chain->time = chain->input_time = time;
    choose_modes(chain);
    for (double left = step, count = 0.0; left > 0.0; count++) {
        double most = STEP_SHARE / fastest(chain), steps = ceil(left / most);
        if (!isfinite(left / most) || count + steps > MOST_STEPS)
            return complain(chain, fmi2Error, "too many internal steps: check the parameters");
        advance(chain, steps > 1.0 ? left / steps : left);
        left = steps > 1.0 ? time + step - chain->time : 0.0;
        if (left < 1e-12 * step) left = 0.0;
    }
    for (int k = 0; k < ACTUATORS; k++) chain->input[k] += chain->slope[k] * step;
    chain->time = chain->input_time = time + step;
    memset(chain->slope, 0, sizeof chain->slope);
    for (int i = 0; i < STATES; i++)
        if (!isfinite(chain->state[i])) return complain(chain, fmi2Error, "the motion grows without bound");
    return fmi2OK;
}

/* What an FMU must have, and this one has no use for. */
#define NOT_THERE(name, ...) \
    EXPORT fmi2Status name(__VA_ARGS__) { return fmi2Error; }
NOT_THERE(fmi2GetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Integer v[])
NOT_THERE(fmi2GetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean v[])
NOT_THERE(fmi2GetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2String v[])
NOT_THERE(fmi2SetInteger, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Integer v[])
NOT_THERE(fmi2SetBoolean, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean v[])
NOT_THERE(fmi2SetString, fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2String v[])
NOT_THERE(fmi2GetFMUstate, fmi2Component c, fmi2FMUstate *state)
NOT_THERE(fmi2SetFMUstate, fmi2Component c, fmi2FMUstate state)
NOT_THERE(fmi2FreeFMUstate, fmi2Component c, fmi2FMUstate *state)
NOT_THERE(fmi2SerializedFMUstateSize, fmi2Component c, fmi2FMUstate state, size_t *size)
NOT_THERE(fmi2SerializeFMUstate, fmi2Component c, fmi2FMUstate state, fmi2Byte bytes[], size_t size)
NOT_THERE(fmi2DeSerializeFMUstate, fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state)
NOT_THERE(fmi2GetDirectionalDerivative, fmi2Component c, const fmi2ValueReference u[], size_t n,
          const fmi2ValueReference k[], size_t m, const fmi2Real du[], fmi2Real dv[])
NOT_THERE(fmi2GetRealOutputDerivatives, fmi2Component c, const fmi2ValueReference vr[], size_t n,
          const fmi2Integer order[], fmi2Real v[])
NOT_THERE(fmi2CancelStep, fmi2Component c)
NOT_THERE(fmi2GetStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Status *v)
NOT_THERE(fmi2GetRealStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Real *v)
NOT_THERE(fmi2GetIntegerStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Integer *v)
NOT_THERE(fmi2GetBooleanStatus, fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *v)
NOT_THERE(fmi2GetStringStatus, fmi2Component c, const fmi2StatusKind kind, fmi2String *v)
