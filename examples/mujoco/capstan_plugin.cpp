/* Capstan friction of spatial tendons as a plugin of MuJoCo, "tendonfmu.capstan": what capstan.py does, in the engine.
 * Its state, in mjData, is the time of the last sample and the friction built up at each object of all paths. */
#include <mujoco/mujoco.h>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

namespace {
struct touch {
  int place, geom, body; /* place among the objects of all paths; geom -1: a site */
  const mjtNum *enters, *leaves;
};

mjtNum number(const mjModel* m, int instance, const char* key) {
  return std::strtod(mj_getPluginConfig(m, instance, key), nullptr);
}

/* force at the motor's end; it pulls only */
mjtNum tension(const mjModel* m, const mjData* d, int i) {
  mjtNum force = m->tendon_damping[i] * d->ten_velocity[i];
  force += m->tendon_stiffness[i] * std::max<mjtNum>(0, d->ten_length[i] - m->tendon_lengthspring[2 * i + 1]);
  for (int k = 0; k < m->nu; ++k) {
    const bool drives = m->actuator_trntype[k] == mjTRN_TENDON && m->actuator_trnid[2 * k] == i;
    force -= drives ? m->actuator_gear[6 * k] * d->actuator_force[k] : 0;
  }
  return std::max<mjtNum>(0, force);
}

std::vector<touch> touched(const mjModel* m, const mjData* d, int tendon) {
  std::vector<touch> path;
  int at = d->ten_wrapadr[tendon];
  for (int k = m->tendon_adr[tendon]; k < m->tendon_adr[tendon] + m->tendon_num[tendon]; ++k) {
    const int index = m->wrap_objid[k], site = m->wrap_type[k] == mjWRAP_SITE, last = at + !site;
    if (m->wrap_type[k] != mjWRAP_JOINT &&
        (site || d->wrap_obj[at] == index)) { /* MuJoCo leaves out a geom that is not touched */
      const int body = site ? m->site_bodyid[index] : m->geom_bodyid[index];
      path.push_back({k, site ? -1 : index, body, d->wrap_xpos + 3 * at, d->wrap_xpos + 3 * last});
      at = last + 1;
    }
  }
  return path;
}

/* integral of the curvature between two directions; around a cylinder it is a helix's */
mjtNum turn(const mjModel* m, const mjData* d, const touch& here, mjtNum comes[3], mjtNum goes[3]) {
  mjtNum bend[3], normal[3] = {0, 0, 0};
  if (here.geom >= 0 && mju_dist3(here.enters, here.leaves) > 0) { /* an arc */
    const mjtNum *frame = d->geom_xmat + 9 * here.geom, axis[3] = {frame[2], frame[5], frame[8]};
    const mjtNum flat = m->geom_type[here.geom] != mjGEOM_SPHERE;
    mju_addToScl3(comes, axis, -flat * mju_dot3(axis, comes));
    mju_addToScl3(goes, axis, -flat * mju_dot3(axis, goes));
    mju_sub3(bend, here.enters, d->geom_xpos + 3 * here.geom);
    mju_cross(normal, bend, comes);
  }
  mju_cross(bend, comes, goes);
  const mjtNum angle = std::atan2(mju_norm3(bend), mju_dot3(comes, goes));
  return mju_norm3(comes) * (mju_dot3(normal, bend) < -1e-9 ? 2 * mjPI - angle : angle); /* over half a turn */
}

void compute(const mjModel* m, mjData* d, int instance, int) {
  mjtNum *time = d->plugin_state + m->plugin_stateadr[instance], *built_up = time + 1;
  const mjtNum step = *time < 0 ? 0 : std::max<mjtNum>(0, d->time - *time);
  const mjtNum friction[] = {number(m, instance, "site_friction"), number(m, instance, "friction")};
  const mjtNum given = number(m, instance, "displacement"), displacement = given > 0 ? given : 5e-5;
  mj_fwdActuation(m, d); /* the forces of this step, which MuJoCo computes after the passive ones */
  std::vector<mjtNum> now(m->nwrap), near(3 * m->nv), far(3 * m->nv);
  for (int i = 0; i < m->ntendon; ++i) {
    const std::vector<touch> path = touched(m, d, i);
    std::vector<mjtNum> pieces(path.size() * m->nv), rate(path.size()), angle(path.size());
    for (int k = int(path.size()) - 2; k > 0; --k) { /* over an object slides what the pieces behind it shorten by */
      mjtNum comes[3], goes[3], *piece = pieces.data() + k * m->nv;
      mju_sub3(comes, path[k].enters, path[k - 1].leaves);
      mju_sub3(goes, path[k + 1].enters, path[k].leaves);
      mju_normalize3(comes);
      mju_normalize3(goes);
      mj_jac(m, d, near.data(), nullptr, path[k].leaves, path[k].body);
      mj_jac(m, d, far.data(), nullptr, path[k + 1].enters, path[k + 1].body);
      mju_subFrom(far.data(), near.data(), 3 * m->nv);
      mju_mulMatTVec(piece, far.data(), goes, 3, m->nv);
      rate[k] = rate[k + 1] - mju_dot(piece, d->qvel, m->nv) / displacement;
      angle[k] = turn(m, d, path[k], comes, goes);
    }
    mjtNum lost = 0, force = tension(m, d, i); /* lost: as a logarithm */
    for (int k = 1; k + 1 < int(path.size()); ++k) {
      mjtNum& share = now[path[k].place];
      share = angle[k] > 0 ? mju_clip(built_up[path[k].place] + step * rate[k], -1, 1) : 0;
      const mjtNum damped = mju_clip(share + 2 * m->opt.timestep * rate[k], -1, 1);
      lost += damped * friction[path[k].geom >= 0] * angle[k];
      mju_addToScl(d->qfrc_passive, pieces.data() + k * m->nv, -std::expm1(-lost) * force, m->nv);
    }
  }
  *time = d->time;
  std::copy(now.begin(), now.end(), built_up);
}

}  // namespace
mjPLUGIN_LIB_INIT(tendonfmu_capstan) {
  static const char* const attributes[] = {"friction", "site_friction", "displacement"};
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = "tendonfmu.capstan";
  plugin.nattribute = 3;
  plugin.attributes = attributes;
  plugin.capabilityflags = mjPLUGIN_PASSIVE;
  plugin.nstate = [](const mjModel* m, int) { return 1 + int(m->nwrap); };
  plugin.init = [](const mjModel* m, mjData*, int) {
    return std::count(m->wrap_type, m->wrap_type + m->nwrap, int(mjWRAP_PULLEY)) ? -1 : 0; /* not for divided tendons */
  };
  plugin.reset = [](const mjModel* m, mjtNum* state, void*, int) {
    std::fill(state + 1, state + 1 + m->nwrap, mjtNum(0));
    *state = -1; /* no sample yet */
  };
  plugin.compute = compute;
  mjp_registerPlugin(&plugin);
}
