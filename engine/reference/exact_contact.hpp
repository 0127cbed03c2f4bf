#pragma once

#include <optional>

#include "reference/shapes.hpp"
#include "ringfence/contact.hpp"
#include "ringfence/pose.hpp"

namespace ringfence::reference {

/// The contact of two placed shapes as the reference would answer it; none if they are apart. Numbers are zero, the
/// phase is begin.
///
/// Where the deepest place is not one point (face on face), or several directions are as good (one centre), it is one
/// of the right answers: compare others' contacts by describe_error, not with this.
std::optional<Contact> exact_contact(const PreparedShape& a, const Pose& pose_a, const PreparedShape& b,
                                     const Pose& pose_b);

}  // namespace ringfence::reference
