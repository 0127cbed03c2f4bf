#include "gateway/edge/admission.hpp"

#include <string>
#include <string_view>

#include <doctest/doctest.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

#include "ringfence/error.hpp"

namespace ringfence::gateway {
namespace {

constexpr std::int64_t now = 1'700'000'000;
const std::string key(32, 'k');

/// Base 64 in the alphabet of URLs without padding (RFC 4648), written for this test.
std::string base64url(std::string_view bytes) {
  constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  std::string text;
  std::uint32_t bits = 0;
  int count = 0;
  for (const char byte : bytes) {
    bits = bits << 8 | static_cast<unsigned char>(byte);
    for (count += 8; count >= 6; count -= 6) text += alphabet[bits >> (count - 6) & 63];
  }
  if (count > 0) text += alphabet[bits << (6 - count) & 63];
  return text;
}

/// A token made without libjwt (RFC 7515).
std::string token(std::string_view claims, std::string_view header = R"({"alg":"HS256","typ":"JWT"})",
                  const EVP_MD* hash = EVP_sha256(), const std::string& secret = key) {
  const std::string signed_part = base64url(header) + "." + base64url(claims);
  unsigned char mac[EVP_MAX_MD_SIZE];
  unsigned size = 0;
  HMAC(hash, secret.data(), static_cast<int>(secret.size()), reinterpret_cast<const unsigned char*>(signed_part.data()),
       signed_part.size(), mac, &size);
  return signed_part + "." + base64url({reinterpret_cast<const char*>(mac), size});
}

std::string claims(std::string_view sub = "\"7\"", std::string_view role = "play", std::string_view aud = "test",
                   std::string_view exp = "1700000001") {
  return R"({"sub":)" + std::string(sub) + R"(,"role":")" + std::string(role) + R"(","aud":")" + std::string(aud) +
         R"(","exp":)" + std::string(exp) + "}";
}

bool is_admitted(std::string_view text, bool watches = false) {
  return Admission("test", key).admit(text, watches, now).reason.empty();
}
CloseCode refusal(std::string_view text, bool watches = false) {
  const Admission::Decision decision = Admission("test", key).admit(text, watches, now);
  REQUIRE(!decision.reason.empty());
  return decision.refusal;
}

TEST_CASE("a token that another program signed by HS256 is admitted as its user") {
  const Admission::Decision decision = Admission("test", key).admit(token(claims()), false, now);
  CHECK(decision.reason.empty());
  CHECK(decision.identity.user == UserId(7));
  CHECK(decision.identity.role == Role::play);
}

TEST_CASE("tokens of spectators and operators are admitted to /watch with their role") {
  const Admission admission("test", key);
  CHECK(admission.admit(token(claims("\"1\"", "watch")), true, now).identity.role == Role::watch);
  CHECK(admission.admit(token(claims("\"1\"", "operate")), true, now).identity.role == Role::operate);
  CHECK(is_admitted(token(claims("\"1\"", "operate")), true));
}

TEST_CASE("a token for one path is forbidden at the other") {
  CHECK(refusal(token(claims()), true) == CloseCode::forbidden);
  CHECK(refusal(token(claims("\"1\"", "watch"))) == CloseCode::forbidden);
  CHECK(refusal(token(claims("\"1\"", "operate"))) == CloseCode::forbidden);
}

TEST_CASE("only HS256 is accepted, whatever the token names") {
  const std::string unsigned_token = base64url(R"({"alg":"none"})") + "." + base64url(claims()) + ".";
  CHECK(refusal(unsigned_token) == CloseCode::unauthorised);
  CHECK(refusal(token(claims(), R"({"alg":"none"})")) == CloseCode::unauthorised);
  CHECK(refusal(token(claims(), R"({"alg":"HS384"})", EVP_sha384())) == CloseCode::unauthorised);
  CHECK(refusal(token(claims(), R"({"alg":"HS512"})", EVP_sha512())) == CloseCode::unauthorised);
  CHECK(refusal(token(claims(), R"({"alg":"RS256"})")) == CloseCode::unauthorised);
  CHECK(refusal(token(claims(), R"({"typ":"JWT"})")) == CloseCode::unauthorised);
}

TEST_CASE("a token with another key, or with any changed character, is refused") {
  CHECK(refusal(token(claims(), R"({"alg":"HS256"})", EVP_sha256(), std::string(32, 'x'))) == CloseCode::unauthorised);
  const std::string good = token(claims());
  REQUIRE(is_admitted(good));
  // The last character has unused bits, so that its change may leave the same signature.
  for (std::size_t i = 0; i + 1 < good.size(); ++i) {
    std::string changed = good;
    changed[i] = changed[i] == 'A' ? 'B' : 'A';
    CAPTURE(i);
    CHECK_FALSE(is_admitted(changed));
  }
  for (std::size_t size = 1; size < good.size(); ++size) {
    CAPTURE(size);
    CHECK_FALSE(is_admitted(good.substr(0, size)));
  }
  CHECK_FALSE(is_admitted(good + std::string(1, '\0')));
}

TEST_CASE("a token is refused from the second in which it expires, and without exp") {
  CHECK(refusal(token(claims("\"7\"", "play", "test", "1700000000"))) == CloseCode::unauthorised);
  CHECK(refusal(token(claims("\"7\"", "play", "test", "\"1800000000\""))) == CloseCode::unauthorised);
  CHECK(refusal(token(R"({"sub":"7","role":"play","aud":"test"})")) == CloseCode::unauthorised);
}

TEST_CASE("a token for another world, another role or no role is refused") {
  CHECK(refusal(token(claims("\"7\"", "play", "tes"))) == CloseCode::unauthorised);
  CHECK(refusal(token(claims("\"7\"", "play", "test2"))) == CloseCode::unauthorised);
  CHECK(refusal(token(claims("\"7\"", "admin"))) == CloseCode::unauthorised);
  CHECK(refusal(token(R"({"sub":"7","aud":"test","exp":1800000000})")) == CloseCode::unauthorised);
}

TEST_CASE("sub has to be a user number") {
  CHECK(is_admitted(token(claims("\"0\""))));
  CHECK(is_admitted(token(claims("\"4294967294\""))));
  for (const char* const sub :
       {"\"4294967295\"", "\"4294967296\"", "\"-1\"", "\"\"", "\"7x\"", "\" 7\"", "7", "null"}) {
    CAPTURE(sub);
    CHECK(refusal(token(claims(sub))) == CloseCode::unauthorised);
  }
}

TEST_CASE("sign_token and admit agree on every role") {
  const Admission admission("test", key);
  for (const Role role : {Role::play, Role::watch, Role::operate}) {
    const std::string text = sign_token({UserId(3), role, "test", now + 1}, key);
    const Admission::Decision decision = admission.admit(text, role != Role::play, now);
    CHECK(decision.reason == "");
    CHECK(decision.identity.role == role);
  }
}

TEST_CASE("without a key guests are admitted, and come back with the token that they were given") {
  const Admission admission("test", "");
  CHECK(admission.admit("", false, now).reason.empty());
  CHECK(admission.admit("", true, now).identity.role == Role::watch);
  CHECK(admission.admit(admission.guest_token(UserId(9), now), false, now).identity.user == UserId(9));
  CHECK(!Admission("test", "").admit(admission.guest_token(UserId(9), now), false, now).reason.empty());
}

TEST_CASE("with a key there are no guests") {
  CHECK(refusal("") == CloseCode::unauthorised);
  CHECK(Admission("test", key).guest_token(UserId(1), now).empty());
}

TEST_CASE("a key that is too short is refused") {
  CHECK_THROWS_AS(Admission("test", std::string(31, 'k')), Error);
  CHECK_THROWS_AS(sign_token({UserId(1), Role::play, "test", now}, std::string(31, 'k')), Error);
}

}  // namespace
}  // namespace ringfence::gateway
