"""The page that shows a watch: a server of Tornado, and one static page of HTML, JavaScript and CSS.

Nothing comes from outside, and the page can change nothing. What is sent to it is in `faintrack.live.page.feed`, who
may see it in `faintrack.live.page.guard`.
"""
