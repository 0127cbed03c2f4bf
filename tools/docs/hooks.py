"""Hook of MkDocs: links the page of the API to the pages of Doxygen, which exist only in the site."""


def on_page_markdown(markdown, page, config, files):
    return markdown.replace("<!-- api link -->", '<a href="api/annotated.html">Open the reference of all classes</a>')
