"""The lines by which a module takes composites back to physical parameters; see `skeleton`."""

from __future__ import annotations

NONLINEAR = '''\
  def physical_from_base(base):
      """<text>"""
      target = np.asarray(base, dtype=float)
      rng = np.random.default_rng(2002)
      nearest, smallest = None, np.inf
      with np.errstate(all="ignore"):
          first, spans = solved_products(target, rng)
          for attempt in range(24):
              # not from one value for all: that may be where a denominator is zero
              spread = 0.1 if attempt == 0 else 3.0
              x = first + spans[0] @ rng.normal(0.0, spread, spans[0].shape[1])
              try:
                  for span in spans:
                      near, miss = newton(target, x, span)
                      if miss > 1e-9:
                          near, miss = newton(target, descent(target, x, span), span)
                      x = near
              except (ArithmeticError, np.linalg.LinAlgError):
                  continue
              if miss < smallest:
                  nearest, smallest = x, miss
              if smallest <= 1e-9:
                  found = in_names(nearest)
                  return {name: found[name] for name in IDENTIFIABLE}
      raise ValueError(f"no parameters give these base parameters: the nearest miss by {smallest:.2g} of it")


  def fit_physical(base, start):
      """<text>"""
      target = np.asarray(base, dtype=float)
      with np.errstate(all="ignore"):
          x = descent(target, np.array(start, dtype=float), np.eye(len(PARAMETERS)))
          p, residual, _ = mismatch(target, x)
      return p, float(residual @ residual)


  def is_signed():
      """<text>"""
      return np.array([ROLES[name]["role"] in ("offset", "stiffness3") for name in PARAMETERS])


  def in_names(x):
      """<text>"""
      signed = is_signed()
      values = np.where(signed, np.sinh(np.where(signed, x, 0.0)), np.exp(np.where(signed, 0.0, x)))
      return dict(zip(PARAMETERS, values.tolist()))


  def mismatch(target, x):
      """<text>"""
      p, signed = in_names(x), is_signed()
      scale = np.where(target == 0.0, 1.0, np.abs(target))
      value = base_from_physical(p)
      same_sign = value * target > 0.0
      logs = np.log(np.where(same_sign, value / np.where(same_sign, target, 1.0), 1.0))
      residual = np.where(same_sign, logs, (value - target) / scale)
      by_variable = base_jacobian(p) * np.where(signed, np.cosh(np.where(signed, x, 0.0)), list(p.values()))
      return p, residual, by_variable / np.where(same_sign, value, scale)[:, None]


  def solved_products(target, rng):
      """<text>"""
      signed, count = is_signed(), len(PARAMETERS)
      solid = np.array([ROLES[name]["role"] in ("inertia", "stiffness") for name in PARAMETERS])
      logs, zero = rng.normal(0.0, 1.0, (2, count)), np.zeros(count, dtype=bool)
      together = base_from_physical(dict(zip(PARAMETERS, np.exp(logs[0]).tolist())))
      for index in np.flatnonzero(~solid):
          # next to nothing, not zero: a denominator may consist of them
          alone = np.where(solid | (np.arange(count) == index), np.exp(logs[0]), 1e-30)
          value = base_from_physical(dict(zip(PARAMETERS, alone.tolist())))
          zero[index] = np.any((np.abs(value) > 1e-15 * np.abs(together)) & (target == 0.0))
      powers, values = [], []
      for x in np.where(zero, -np.inf, logs):
          p = dict(zip(PARAMETERS, np.exp(x).tolist()))
          values.append(base_from_physical(p))
          powers.append(base_jacobian(p) * np.exp(x) / np.where(values[-1] == 0.0, 1.0, values[-1])[:, None])
      product = np.all(np.abs(powers[0] - powers[1]) < 1e-9, axis=1) & (target * values[0] > 0.0)
      product &= ~np.any(powers[0][:, signed] != 0.0, axis=1)
      A = np.round(powers[0][product][:, ~zero])
      b = np.log(target[product] / values[0][product]) + A @ logs[0][~zero]
      first = np.where(signed, 0.0, np.where(zero, -np.inf, 0.0))
      first[~zero] = np.linalg.lstsq(A, b, rcond=1e-9)[0]
      _, sizes, directions = np.linalg.svd(A)
      every = np.eye(count)[:, ~zero]
      return first, (every @ directions[np.sum(sizes > 1e-9) :].T, every)


  def newton(target, x, span):
      """<text>"""
      best, least, when = x, np.inf, 0
      for step in range(25):
          p, residual, slope = mismatch(target, x)
          miss = np.abs(base_from_physical(p) - target) / np.where(target == 0.0, 1.0, np.abs(target))
          if np.max(miss) < least:
              best, least, when = x, float(np.max(miss)), step
          if not np.isfinite(residual).all() or least < 1e-11 or step > when + 10:
              break
          move = span @ np.linalg.lstsq(slope @ span, -residual, rcond=1e-13)[0]
          move *= min(1.0, 5.0 / max(np.abs(move).max(), 5.0))
          x = np.clip(x + move, np.where(x == -np.inf, x, -60.0), 60.0)
      return best, least


  def descent(target, x, span):
      """<text>"""
      damping, slow = 1e-2, 0
      _, residual, slope = mismatch(target, x)
      for _ in range(100):
          rows = np.vstack([slope @ span, np.sqrt(damping) * np.eye(span.shape[1])])
          step = np.linalg.lstsq(rows, np.concatenate([-residual, np.zeros(span.shape[1])]), rcond=None)[0]
          step = np.clip(step, -3.0, 3.0)
          moved = np.clip(x + span @ step, np.where(x == -np.inf, x, -60.0), 60.0)
          _, trial, turned = mismatch(target, moved)
          if trial @ trial < residual @ residual:
              slow = slow + 1 if trial @ trial > 0.9 * (residual @ residual) else 0
              x, residual, slope, damping = moved, trial, turned, max(damping / 10.0, 1e-16)
          else:
              damping *= 10.0
          if np.abs(step).max(initial=0.0) < 1e-14 or damping > 1e12 or slow > 8:
              break
      return x


'''
