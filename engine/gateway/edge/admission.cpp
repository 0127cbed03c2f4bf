#include "gateway/edge/admission.hpp"

#include <array>
#include <charconv>
#include <cstdlib>
#include <memory>
#include <string>

#include <jwt.h>
#include <openssl/rand.h>

#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

constexpr std::int64_t guest_token_s = 24 * 3600;

struct FreeJwt {
  void operator()(jwt_t* token) const noexcept { jwt_free(token); }
};
using Jwt = std::unique_ptr<jwt_t, FreeJwt>;

const unsigned char* bytes_of(std::string_view key) noexcept {
  return reinterpret_cast<const unsigned char*>(key.data());
}

/// The value of a claim that is a text; empty if it is missing or something else.
std::string_view text_of(jwt_t* token, const char* claim) noexcept {
  const char* const text = jwt_get_grant(token, claim);
  return text == nullptr ? std::string_view() : std::string_view(text);
}

/// A user number, which is written as a text, as `sub` has to be.
UserId user_of(std::string_view text) noexcept {
  std::uint32_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  const bool is_number = !text.empty() && error == std::errc() && end == text.data() + text.size();
  return is_number ? UserId(number) : no_user;
}

std::string random_key() {
  std::array<unsigned char, least_token_key> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) throw Error("the system has no random numbers");
  return {bytes.begin(), bytes.end()};
}

}  // namespace

const char* name_of(Role role) noexcept {
  constexpr std::array names{"play", "watch", "operate"};
  return names[static_cast<std::size_t>(role)];
}

std::optional<Role> role_of(std::string_view name) noexcept {
  for (const Role role : {Role::play, Role::watch, Role::operate}) {
    if (name == name_of(role)) return role;
  }
  return std::nullopt;
}

std::string sign_token(const TokenClaims& claims, std::string_view key) {
  if (key.size() < least_token_key) {
    throw Error("the key for tokens has " + std::to_string(key.size()) + " bytes; expected at least 32");
  }
  jwt_t* made = nullptr;
  if (jwt_new(&made) != 0) throw std::bad_alloc();
  const Jwt token(made);
  bool is_done = jwt_set_alg(made, JWT_ALG_HS256, bytes_of(key), static_cast<int>(key.size())) == 0 &&
                 jwt_add_grant(made, "aud", claims.world.c_str()) == 0 &&
                 jwt_add_grant(made, "role", name_of(claims.role)) == 0 &&
                 jwt_add_grant_int(made, "exp", static_cast<long>(claims.expires)) == 0;
  if (claims.user) is_done = is_done && jwt_add_grant(made, "sub", std::to_string(claims.user.number()).c_str()) == 0;
  const std::unique_ptr<char, decltype(&std::free)> text(is_done ? jwt_encode_str(made) : nullptr, &std::free);
  if (text == nullptr) throw Error("the token cannot be signed");
  return text.get();
}

Admission::Admission(std::string world, std::string key)
    : world_(std::move(world)), key_(std::move(key)), admits_guests_(key_.empty()) {
  if (admits_guests_) key_ = random_key();
  if (key_.size() < least_token_key) {
    throw Error("the key for tokens has " + std::to_string(key_.size()) + " bytes; expected at least 32");
  }
}

Admission::Decision Admission::admit(std::string_view token, bool watches, std::int64_t now) const {
  Decision decision;
  decision.identity.role = watches ? Role::watch : Role::play;
  if (token.empty()) {
    if (!admits_guests_) decision.reason = "hello: a token is required";
    return decision;
  }
  const auto refuse = [&](CloseCode code, const char* reason) {
    decision.refusal = code;
    decision.reason = reason;
    return decision;
  };
  jwt_t* read = nullptr;
  const std::string text(token);
  if (text.size() != token.size() || text.find('\0') != std::string::npos ||
      jwt_decode(&read, text.c_str(), bytes_of(key_), static_cast<int>(key_.size())) != 0) {
    return refuse(CloseCode::unauthorised, "token: not signed with the key of this world");
  }
  const Jwt owner(read);
  // jwt_decode verifies by the algorithm that the token names, also none.
  if (jwt_get_alg(read) != JWT_ALG_HS256) return refuse(CloseCode::unauthorised, "token: not HS256");
  if (jwt_get_grant_int(read, "exp") <= now) return refuse(CloseCode::unauthorised, "token: expired, or without exp");
  if (text_of(read, "aud") != world_) return refuse(CloseCode::unauthorised, "token: for another world");
  const std::optional<Role> role = role_of(text_of(read, "role"));
  if (!role) return refuse(CloseCode::unauthorised, "token: role must be play, watch or operate");
  if ((*role == Role::play) == watches) {
    return refuse(CloseCode::forbidden, watches ? "the token permits /play only" : "the token permits /watch only");
  }
  decision.identity.role = *role;
  if (*role != Role::play) return decision;
  decision.identity.user = user_of(text_of(read, "sub"));
  if (!decision.identity.user) return refuse(CloseCode::unauthorised, "token: sub must be a user number");
  return decision;
}

std::string Admission::guest_token(UserId user, std::int64_t now) const {
  if (!admits_guests_) return {};
  return sign_token({user, Role::play, world_, now + guest_token_s}, key_);
}

}  // namespace ringfence::gateway
