#include "gateway/edge/tls.hpp"

#include <string>

#include <boost/system/error_code.hpp>

#include "ringfence/error.hpp"

namespace ringfence::gateway {

std::unique_ptr<boost::asio::ssl::context> make_tls(const EdgeConfig& config) {
  namespace ssl = boost::asio::ssl;
  if (config.certificate_file.empty() || config.key_file.empty()) return nullptr;
  auto tls = std::make_unique<ssl::context>(ssl::context::tls_server);
  tls->set_options(ssl::context::default_workarounds | ssl::context::no_sslv2 | ssl::context::no_sslv3 |
                   ssl::context::no_tlsv1 | ssl::context::no_tlsv1_1);
  boost::system::error_code error;
  tls->use_certificate_chain_file(config.certificate_file, error);
  if (error) throw Error("the certificate " + config.certificate_file + " cannot be read: " + error.message());
  tls->use_private_key_file(config.key_file, ssl::context::pem, error);
  if (error) {
    throw Error("the key " + config.key_file + " cannot be read, or does not fit the certificate: " + error.message());
  }
  return tls;
}

}  // namespace ringfence::gateway
