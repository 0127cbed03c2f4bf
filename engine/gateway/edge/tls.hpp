#pragma once

#include <memory>

#include <boost/asio/ssl/context.hpp>

#include "gateway/edge/edge_config.hpp"

namespace ringfence::gateway {

/// A context for TLS 1.2 and 1.3 with the certificate and key of the configuration; null if it has none. Throws Error.
std::unique_ptr<boost::asio::ssl::context> make_tls(const EdgeConfig& config);

}  // namespace ringfence::gateway
