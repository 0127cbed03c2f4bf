#pragma once

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/basic_stream.hpp>
#include <boost/beast/core/error.hpp>
#include <boost/beast/core/rate_policy.hpp>
#include <boost/beast/ssl/ssl_stream.hpp>

// The types of Boost that the edge uses. They name the executor of an io_context, which costs less for each operation
// than the polymorphic executor that is the default.

namespace ringfence::gateway {

namespace net = boost::asio;
namespace beast = boost::beast;
using Executor = net::io_context::executor_type;
using Tcp = net::ip::tcp;
using PlainStream = beast::basic_stream<Tcp, Executor, beast::unlimited_rate_policy>;
using TlsStream = beast::ssl_stream<PlainStream>;
using Timer =
    net::basic_waitable_timer<std::chrono::steady_clock, net::wait_traits<std::chrono::steady_clock>, Executor>;
using boost::system::error_code;

}  // namespace ringfence::gateway
