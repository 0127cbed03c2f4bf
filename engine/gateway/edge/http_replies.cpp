#include "gateway/edge/http_replies.hpp"

#include <algorithm>

#include "gateway/edge/page_files.hpp"

namespace ringfence::gateway {
namespace {

namespace http = boost::beast::http;

HttpResponse make_reply(const HttpRequest& request, http::status status, std::string_view type, std::string body) {
  HttpResponse reply(status, request.version());
  reply.set(http::field::content_type, boost::beast::string_view(type.data(), type.size()));
  reply.set("X-Content-Type-Options", "nosniff");
  reply.set("Referrer-Policy", "no-referrer");
  reply.set("Content-Security-Policy",
            "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'");
  reply.set("Cross-Origin-Opener-Policy", "same-origin");
  reply.keep_alive(request.keep_alive());
  reply.body() = std::move(body);
  reply.prepare_payload();
  if (request.method() == http::verb::head) reply.body().clear();
  return reply;
}

HttpResponse text_reply(const HttpRequest& request, http::status status, std::string body) {
  return make_reply(request, status, "text/plain; charset=utf-8", std::move(body));
}

std::string_view view(boost::beast::string_view text) noexcept { return {text.data(), text.size()}; }

/// The path of the request, without the query.
std::string_view path_of(const HttpRequest& request) noexcept {
  const std::string_view target = view(request.target());
  return target.substr(0, target.find('?'));
}

HttpResponse file_reply(const HttpRequest& request, const PageFiles::File& file) {
  if (view(request[http::field::if_none_match]) == file.tag) {
    HttpResponse reply = make_reply(request, http::status::not_modified, file.type, {});
    reply.set(http::field::etag, file.tag);
    return reply;
  }
  HttpResponse reply = make_reply(request, http::status::ok, file.type, file.body);
  reply.set(http::field::etag, file.tag);
  reply.set(http::field::cache_control, "no-cache");
  return reply;
}

/// Whether the page that asks belongs to this gateway, or to an origin that may connect. Programs that are not browsers
/// send no origin.
bool is_origin_allowed(const HttpRequest& request, const EdgeConfig& config) {
  const std::string_view origin = view(request[http::field::origin]);
  if (origin.empty()) return true;
  if (!config.origins.empty()) return std::ranges::find(config.origins, origin) != config.origins.end();
  const std::size_t scheme = origin.find("://");
  return scheme != std::string_view::npos && origin.substr(scheme + 3) == view(request[http::field::host]);
}

/// Whether the browser of a guest may have been led here by a page of another site, whose name has this machine's
/// address. A gateway for guests is only reached by the names of this machine.
bool is_foreign_host(const HttpRequest& request, const EdgeConfig& config) {
  if (!config.token_key.empty() || !config.origins.empty() || view(request[http::field::origin]).empty()) return false;
  const std::string_view host = view(request[http::field::host]);
  const std::string name(host.starts_with('[') ? host.substr(0, host.find(']') + 1) : host.substr(0, host.find(':')));
  error_code error;
  const auto address = net::ip::make_address_v4(name, error);
  return name != "localhost" && name != "[::1]" && (error || !address.is_loopback());
}

}  // namespace

HttpResponse reply_to(const HttpRequest& request, const Hub& hub, bool is_loopback) {
  if (request.method() != http::verb::get && request.method() != http::verb::head) {
    HttpResponse reply = text_reply(request, http::status::method_not_allowed, "only GET and HEAD\n");
    reply.set(http::field::allow, "GET, HEAD");
    return reply;
  }
  const std::string_view path = path_of(request);
  if (path == "/healthz") return text_reply(request, http::status::ok, "ok\n");
  if (path == "/metrics") {
    if (!is_loopback) return text_reply(request, http::status::forbidden, "only from this machine\n");
    return make_reply(request, http::status::ok, "text/plain; version=0.0.4; charset=utf-8",
                      hub.metrics() + (hub.config().serves_clients ? metrics_text(hub.counters()) : ""));
  }
  if (!hub.config().serves_clients) {
    return text_reply(request, http::status::not_found, "there are only /metrics and /healthz\n");
  }
  if (path == "/play" || path == "/watch") {
    HttpResponse reply = text_reply(request, http::status::upgrade_required, "this path is for WebSockets\n");
    reply.set(http::field::upgrade, "websocket");
    return reply;
  }
  if (const PageFiles::File* const file = hub.page().find(path); file != nullptr) return file_reply(request, *file);
  if (path == "/") {
    return text_reply(request, http::status::ok,
                      "This is a Ringfence gateway without a page. Clients connect to /play or /watch.\n");
  }
  return text_reply(request, http::status::not_found, "there is no such file\n");
}

HttpResponse refuse_upgrade(const HttpRequest& request, const EdgeConfig& config) {
  const std::string_view path = path_of(request);
  if (!config.serves_clients || (path != "/play" && path != "/watch")) {
    return text_reply(request, http::status::not_found, "WebSockets are at /play and /watch\n");
  }
  if (!is_origin_allowed(request, config) || is_foreign_host(request, config)) {
    return text_reply(request, http::status::forbidden, "this page's origin may not connect\n");
  }
  return {};
}

std::string metrics_text(const EdgeCounters& counters) {
  std::string text;
  const auto add = [&](const char* name, const char* type, const char* help, std::uint64_t value) {
    text += std::string("# HELP ") + name + " " + help + "\n# TYPE " + name + " " + type + "\n" + name + " " +
            std::to_string(value) + "\n";
  };
  const auto value = [](const EdgeCounters::Counter& counter) { return counter.load(std::memory_order_relaxed); };
  add("ringfence_gateway_connections_total", "counter", "Connections accepted.", value(counters.connections));
  add("ringfence_gateway_connections", "gauge", "Connections that are open.", value(counters.open));
  add("ringfence_gateway_clients", "gauge", "Connections whose hello was accepted.", value(counters.admitted));
  add("ringfence_gateway_http_requests_total", "counter", "Requests that are not for a WebSocket.",
      value(counters.requests));
  add("ringfence_gateway_received_messages_total", "counter", "Messages of clients.",
      value(counters.received_messages));
  add("ringfence_gateway_received_bytes_total", "counter", "Bytes of the messages of clients.",
      value(counters.received_bytes));
  add("ringfence_gateway_sent_messages_total", "counter", "Messages to clients.", value(counters.sent_messages));
  add("ringfence_gateway_sent_bytes_total", "counter", "Bytes of the messages to clients.", value(counters.sent_bytes));
  add("ringfence_gateway_replaced_updates_total", "counter", "Updates that a newer one replaced before they were sent.",
      value(counters.replaced));
  text +=
      "# HELP ringfence_gateway_closed_total Connections that the gateway closed, by code.\n"
      "# TYPE ringfence_gateway_closed_total counter\n";
  for (std::size_t i = 0; i < close_codes.size(); ++i) {
    text += "ringfence_gateway_closed_total{code=\"" + std::to_string(static_cast<unsigned>(close_codes[i])) + "\"} " +
            std::to_string(value(counters.closed[i])) + "\n";
  }
  return text;
}

}  // namespace ringfence::gateway
