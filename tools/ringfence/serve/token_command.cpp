#include "serve/token_command.hpp"

#include <ctime>
#include <fstream>
#include <iterator>

#include <fmt/format.h>

#include "exit_code.hpp"
#include "gateway/edge/admission.hpp"
#include "ringfence/error.hpp"

namespace ringfence::tools {

std::string read_token_key(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  std::string key{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  if (!stream) throw Error(fmt::format("{}: cannot be read; expected a file with the key of the tokens", path));
  // Editors end a file with a newline, which does not belong to the key.
  while (key.ends_with('\n') || key.ends_with('\r')) key.pop_back();
  if (key.size() < gateway::least_token_key) {
    throw Error(fmt::format("{}: found a key of {} bytes; expected at least {}, such as of openssl rand -hex 32", path,
                            key.size(), gateway::least_token_key));
  }
  return key;
}

int print_token(const TokenOptions& options) {
  gateway::TokenClaims claims;
  const std::optional<gateway::Role> role = gateway::role_of(options.role);
  claims.role = role.value_or(gateway::Role::play);
  if (options.has_user) claims.user = UserId(options.user);
  if (claims.role == gateway::Role::play && !options.has_user) {
    throw Error("--user: required with --role play; it is the number of the player");
  }
  claims.world = options.world;
  claims.expires = std::time(nullptr) + options.expires_s;
  fmt::print("{}\n", gateway::sign_token(claims, read_token_key(options.key)));
  return done;
}

}  // namespace ringfence::tools
