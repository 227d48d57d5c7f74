/* What the papers' robot and load models lack, as physics: torques, forces and states that act on the plant.
 *
 * Data flow: the plant asks for them once per stage of its integration, if `present` is set; with nothing
 * present they cost nothing. Signs: a torque of an effect is what the drive must deliver in addition, so
 * friction, springs and ripples count positive where they resist.
 *
 * States that belong to dry friction (bristles) relax within microseconds at high speed. They are advanced by
 * the implicit Euler rule, which is stable at any speed and exact when sliding; all other states are
 * integrated with the plant.
 *
 * Ownership: part of the plant; the history of the delayed force is the caller's. Cannot fail.
 */
#ifndef IMPID_EFFECTS_H
#define IMPID_EFFECTS_H

#include <stdint.h>

#define IMPID_EFFECTS_TERMS  16u
#define IMPID_EFFECTS_STATES 8u /* motor angles, motor speeds, resonator angles, resonator speeds */
/* Per tick: torque on joint 1, 2 (N m); push on the load's side x, y (N); shift of the load's equilibrium
 * x, y (m). */
#define IMPID_EFFECTS_INPUTS 6u
#define IMPID_EFFECTS_SLIPS  4u

/* Springs in parallel, each of which slips at its own limit (Maxwell's slip model). */
typedef struct {
    double level[IMPID_EFFECTS_SLIPS]; /* N m or N; 0: absent */
    double limit[IMPID_EFFECTS_SLIPS]; /* rad or m; > 0 */
    double at[IMPID_EFFECTS_SLIPS];    /* state: how far each is stretched */
} impid_effects_slip;

/* Dry friction of one joint: a bristle that bends by `presliding` before it slides (Dahl). */
typedef struct {
    double presliding;     /* rad; > 0 */
    double level[2];       /* Coulomb level for positive and negative speed, N m */
    double stribeck;       /* more of it at standstill, N m */
    double stribeck_speed; /* rad/s; > 0 */
    double quadratic;      /* N m s^2/rad^2 */
    double viscous[2];     /* beyond alpha, for positive and negative speed, N m s/rad */
    double warm_level;     /* more while cold, N m */
    double warm_viscous;   /* more while cold, N m s/rad */
    double warm_time;      /* s; > 0 */
    double per_force;      /* of the level on the load's force, m */
    double per_torque;     /* of the level on the torque that passes through the joint */
    double spring_level;   /* of one more bristle, which bends far before it slides, N m */
    double spring_width;   /* rad; > 0 */
    impid_effects_slip slip;
    double bend;        /* state, -1 to 1 of the presliding */
    double spring_bend; /* state, -1 to 1 */
} impid_effects_friction;

/* A torque that depends on the angle of one joint. */
typedef struct {
    int32_t kind;  /* IMPID_EFFECTS_SPRING ... */
    int32_t joint; /* 0, 1 */
    double size;   /* N m/rad for the spring, N m s/rad for the viscous ripple, else N m */
    double a;      /* rest (rad); turns per rad; centre (rad) */
    double b;      /* phase (rad); width (rad) */
} impid_effects_term;

enum {
    IMPID_EFFECTS_SPRING = 0,
    IMPID_EFFECTS_RIPPLE = 1,
    IMPID_EFFECTS_BUMP = 2,
    IMPID_EFFECTS_DRY_RIPPLE = 3,
    IMPID_EFFECTS_VISCOUS_RIPPLE = 4
};

/* Something turning that is coupled to a joint by a spring: the motor, or a structure that resonates. */
typedef struct {
    double inertia;   /* kg m^2; 0: absent */
    double stiffness; /* N m/rad */
    double damping;   /* N m s/rad */
} impid_effects_coupled;

typedef struct {
    double cubic[2];       /* along x and y, N/m^3 */
    double cubic_radial;   /* N/m^3 */
    double dry[2];         /* level of the hysteresis along x and y, N */
    double dry_width;      /* m; > 0 */
    double play_half[2];   /* m */
    double late_k, late_b; /* N/m, N s/m: the delayed force */
    double late_steps;     /* delay in steps of the integration, >= 1; 0: absent */
    double steps_per_s;    /* of the integration */
    double drift[2];       /* of the equilibrium, m/s */
    double drift_from;     /* s: when the equilibrium stands at x0 */
    int32_t course;        /* IMPID_EFFECTS_CONSTANT ...: of what follows */
    double more_M[4];      /* what is added to M, B and K at the course's value of one */
    double more_B[4];
    double more_K[4];
    double course_from;  /* s: the middle of the course */
    double course_span;  /* s: from end to end of the ramp; period of the sine */
    double course_phase; /* rad: of the sine */
    double bend[2];      /* state, -1 to 1 */
    double *history;     /* rows of x - x0, y - y0, vx, vy, one per step; a ring */
    int32_t history_rows;
    int32_t history_at; /* the row that was written last */
} impid_effects_load;

/* How M, B and K change: from -1/2 to 1/2 evenly or at once, or as a sine of amplitude one. */
enum { IMPID_EFFECTS_CONSTANT = 0, IMPID_EFFECTS_RAMP = 1, IMPID_EFFECTS_JUMP = 2, IMPID_EFFECTS_SINE = 3 };

typedef struct {
    int32_t present; /* 0: nothing below is looked at */
    impid_effects_friction friction[2];
    int32_t terms;
    impid_effects_term term[IMPID_EFFECTS_TERMS];
    double gain[2];                 /* true over commanded torque */
    double offset[2];               /* N m, lost between command and joint */
    double fade[2];                 /* share of the gain that goes as the motors warm up */
    double fade_s;                  /* time constant of that; > 0 */
    double fade_from;               /* s that they have been warm for when the motion begins */
    double lag_s[2];                /* time constant of the drive; 0: it follows its command at once */
    double creep[2];                /* the encoder runs ahead by so much per torque and way, rad/(N m rad) */
    double inertia12;               /* constant, couples both links, kg m^2 */
    double tip_stiffness[4];        /* of springs that pull at the end-effector, N/m, row by row */
    double tip_pull[2];             /* their force at x = 0, N */
    double tip_damping[4];          /* N s/m */
    impid_effects_slip tip_slip[2]; /* along x and y */
    double weight_sin[2];           /* weight of a link: torques on its angle, N m; they resist */
    double weight_cos[2];
    double gravity[2]; /* in-plane, m/s^2 */
    double moment[2];  /* first moments of the links about their axes, kg m */
    impid_effects_coupled motor[2];
    impid_effects_coupled resonator[2];
    impid_effects_load load;
    double state[IMPID_EFFECTS_STATES];
    double time_s;    /* since the motion began */
    double force;     /* magnitude of the load's force over the last step, N */
    double lagged[2]; /* torque of the drives after their lag, N m */
    double crept[2];  /* by how much the encoders run ahead, rad */
    double place[2];  /* of the end-effector at the last step, m */
} impid_effects;

/* Where the plant is at one stage of a step. */
typedef struct {
    double since;      /* s since the step began */
    double q[2], w[2]; /* of the links, absolute */
    double p[2], u[2]; /* of the joints: what encoders, drives and bearings know */
    double x[2];       /* end-effector, m */
    double v[2];       /* m/s */
    double state[IMPID_EFFECTS_STATES];
    double held[2];   /* torque commanded, N m */
    double torque[2]; /* what comes of it at the joints or motors, N m */
    double input[IMPID_EFFECTS_INPUTS];
} impid_effects_stage;

/* The torque that the drive of joint j exerts of the one it is told to. */
double impid_effects_arriving(const impid_effects *e, const impid_effects_stage *s, int j);
/* What the course of the load's changes is at now. */
double impid_effects_course(const impid_effects *e, double since);
/* The pull of parallel slipping springs after so much more way, and the end of a step of that way. */
double impid_effects_slip_pull(const impid_effects_slip *slip, double moved);
void impid_effects_slip_step(impid_effects_slip *slip, double moved);
/* Friction: the torque that resists at joint j. */
double impid_effects_friction_torque(const impid_effects *e, const impid_effects_stage *s, int j);
/* The end of a step in which the joints turned by `turned` (rad). */
void impid_effects_friction_step(impid_effects *e, const double *turned);
/* Angle terms of the kinds SPRING, RIPPLE and BUMP: the torque that resists at joint j. */
double impid_effects_angle_torque(const impid_effects *e, const impid_effects_stage *s, int j);
/* What reaches joint j of the drive's torque, through compliance and past a resonator; and the rates of
 * the states. */
double impid_effects_drive_torque(const impid_effects *e, const impid_effects_stage *s, int j, double *rate);
/* Springs, dampers at the end-effector: force on the robot, N; and gravity on the links: torque, N m. */
void impid_effects_tip(const impid_effects *e, const impid_effects_stage *s, double *force, double *torque);
/* The end of a step: drives and encoders, whose joints turned by `turned` (rad). */
void impid_effects_drive_step(impid_effects *e, const impid_effects_stage *s, const double *turned,
                              double dt);
/* What the load exerts beyond -(M x'' + B x' + K (x - x0)), N: d is x - x0 before drift and input. */
void impid_effects_load_force(const impid_effects *e, const impid_effects_stage *s, const double *M,
                              const double *K, const double *d, double *force);
/* The end of a step: the end-effector is at x (m). */
void impid_effects_tip_step(impid_effects *e, const double *x);
/* The end of a step: moved (m) over it, at d with velocity v at its end. */
void impid_effects_load_step(impid_effects *e, const double *moved, const double *d, const double *v);

#endif
