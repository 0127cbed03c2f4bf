#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>

#include "gateway/edge/hub.hpp"

namespace ringfence::gateway {

using HttpRequest = boost::beast::http::request<boost::beast::http::string_body>;
using HttpResponse = boost::beast::http::response<boost::beast::http::string_body>;

/// The answer to a request that is not for a WebSocket. `is_loopback`: whether it comes from this machine.
HttpResponse reply_to(const HttpRequest& request, const Hub& hub, bool is_loopback);

/// Why a request for a WebSocket is refused, as an answer; has no body if it is not.
HttpResponse refuse_upgrade(const HttpRequest& request, const EdgeConfig& config);

/// The Prometheus text of the edge's own counters.
std::string metrics_text(const EdgeCounters& counters);

}  // namespace ringfence::gateway
