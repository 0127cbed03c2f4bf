#pragma once

#include <optional>

#include "reference/shapes.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// The contact of two placed shapes according to the reference; none if they are apart. Only the geometry is set; the
/// phase is begin.
///
/// Where the deepest place is not a single point (face on face), or several directions have the same depth (coinciding
/// centres), the result is one of several right ones: check other contacts with describe_error instead of comparing
/// them with this one.
std::optional<Contact> exact_contact(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b,
                                     const Pose& pose_b);

/// Contact::arm_a or arm_b of a contact at `point`, for the object with that pose.
Vec3f arm(const Vec3d& point, const Pose& pose);

}  // namespace ringfence::reference
