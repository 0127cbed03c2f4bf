#pragma once

#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>
#include <unistd.h>

namespace ringfence::gateway {

/// A certificate that signs itself, and its key, in files that are removed with it.
class Certificate {
 public:
  explicit Certificate(const std::string& name) {
    const auto directory = std::filesystem::temp_directory_path();
    const std::string stem = "gateway_tls_test." + std::to_string(getpid()) + "." + name;
    certificate_ = (directory / (stem + ".pem")).string();
    key_ = (directory / (stem + ".key")).string();
    const std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)> key(EVP_EC_gen("P-256"), &EVP_PKEY_free);
    const std::unique_ptr<X509, decltype(&X509_free)> certificate(X509_new(), &X509_free);
    X509_set_version(certificate.get(), 2);
    ASN1_INTEGER_set(X509_get_serialNumber(certificate.get()), 1);
    X509_gmtime_adj(X509_getm_notBefore(certificate.get()), 0);
    X509_gmtime_adj(X509_getm_notAfter(certificate.get()), 3600);
    X509_set_pubkey(certificate.get(), key.get());
    X509_NAME* const subject = X509_get_subject_name(certificate.get());
    X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>("localhost"), -1, -1,
                               0);
    X509_set_issuer_name(certificate.get(), subject);
    X509_sign(certificate.get(), key.get(), EVP_sha256());
    std::FILE* const certificate_file = std::fopen(certificate_.c_str(), "w");
    PEM_write_X509(certificate_file, certificate.get());
    std::fclose(certificate_file);
    std::FILE* const key_file = std::fopen(key_.c_str(), "w");
    PEM_write_PrivateKey(key_file, key.get(), nullptr, nullptr, 0, nullptr, nullptr);
    std::fclose(key_file);
  }
  ~Certificate() {
    std::filesystem::remove(certificate_);
    std::filesystem::remove(key_);
  }
  Certificate(const Certificate&) = delete;
  Certificate& operator=(const Certificate&) = delete;

  const std::string& certificate_file() const { return certificate_; }
  const std::string& key_file() const { return key_; }

 private:
  std::string certificate_, key_;
};

}  // namespace ringfence::gateway
