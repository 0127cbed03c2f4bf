#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "gateway/transport.hpp"

namespace ringfence::gateway {

/// Fewest bytes of a key that signs tokens: as many as HS256 has.
inline constexpr std::size_t least_token_key = 32;

/// What a token says. Times in seconds since 1970.
struct TokenClaims {
  UserId user = no_user;  ///< `sub`; no_user: none
  Role role = Role::play;
  std::string world;  ///< `aud`
  std::int64_t expires = 0;
};

/// Signs a token: a JWT with HS256. Throws Error if the key has less than least_token_key bytes.
std::string sign_token(const TokenClaims& claims, std::string_view key);

/// The roles' names in tokens: "play", "watch", "operate".
const char* name_of(Role role) noexcept;
std::optional<Role> role_of(std::string_view name) noexcept;

/// Decides who may connect, from the token of the hello and the path of the connection.
///
/// Threads: any number may call it.
class Admission {
 public:
  /// With an empty key, guests are admitted, and tokens are signed with a random key of this process.
  Admission(std::string world, std::string key);

  struct Decision {
    Identity identity;
    CloseCode refusal = CloseCode::unauthorised;  ///< if there is a reason
    std::string reason;                           ///< empty: admitted
  };
  /// `watches`: whether the path is /watch. `now`: seconds since 1970.
  Decision admit(std::string_view token, bool watches, std::int64_t now) const;
  /// A token with which a guest can come back for a day. Empty if there are no guests.
  std::string guest_token(UserId user, std::int64_t now) const;

 private:
  std::string world_;
  std::string key_;
  bool admits_guests_;
};

}  // namespace ringfence::gateway
